// A bake on this machine: the farm's server and a worker in this process. What is done is kept until the asset is whole, so
// that a bake that was stopped goes on.
#pragma once

#include <string>

#include "core/bake/bake.h"

namespace lightloom {

/// Bakes into the folder `loom`, and keeps its state in `loom`.partial meanwhile. `control.progress` is told of the stages
/// "receivers" and "probes", and then of tasks. Errors: those of planning, of tasks, of writing; cancellation, which says
/// what is left.
absl::StatusOr<BakeReport> local_bake(const RayTracer& tracer, const BakeParams& params, const std::string& loom,
                                      const BakeControl& control);

}  // namespace lightloom
