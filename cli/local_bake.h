// A bake on this machine: the farm's server and a worker in this process. What is done is kept until the asset is whole, so
// that a bake that was stopped goes on.
#pragma once

#include <functional>
#include <string>

#include "cli/earlier_bake.h"
#include "core/bake/bake.h"

namespace lightloom {

struct LocalBake {
  BakeParams params;
  std::string loom;                      ///< the folder; its state is kept in `loom`.partial meanwhile
  const EarlierBake* earlier = nullptr;  ///< what holds of it is taken over
  /// Told what holds of the earlier bake, before any of the rest is baked. False: that was all that was asked.
  std::function<bool(const BakeSession&, const Reuse&)> planned;
};

/// `control.progress` is told of the stages "receivers" and "probes", and then of tasks. Errors: those of planning, of
/// tasks, of writing; cancellation, which says what is left.
absl::StatusOr<BakeReport> local_bake(const RayTracer& tracer, const LocalBake& bake, const BakeControl& control);

}  // namespace lightloom
