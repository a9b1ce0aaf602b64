// Where radiance is sampled at run time: one probe per cell of the world grid near receivers, and repairs where those
// do not see what receivers see. Every decision looks at geometry and receivers within a fixed distance only, so an edit
// moves no probe far away (SL17 Sec. 4.1 thins global candidates instead, which any edit reshuffles).
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/parallel.h"
#include "core/base/status.h"
#include "core/probes/probe_name.h"
#include "core/receivers/receivers.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

struct Probe {
  Vec3 position;
  GridCell cell{};    ///< world cell of side `spacing`
  uint32_t slot = 0;  ///< 0: base probe; 1 + octant: repair. SL17: a number
  ProbeName name() const { return {cell, slot}; }
};

std::vector<Vec3> positions_of(const std::vector<Probe>& probes);

struct PlacementOptions {
  float spacing = 1;  ///< ρ, metres
  int nearest = 22;   ///< how many probes a receiver can reach: links and fallbacks
};

struct PlacementResult {
  std::vector<Probe> probes;  ///< sorted by name
  double unseen = 0;   ///< share of test rays whose hit, or sky, no base probe in reach sees: what repair starts from
  size_t repairs = 0;  ///< probes added by repair
  float radius = 0;    ///< of every probe's support (SL17), metres; 0: receivers read their nearest probes
};
/// Base probes are placed for the front sides; back sides that none of them in reach sees are then dropped from
/// `receivers`: they lie in cavities that no light of the level's open space enters and no camera looks into.
absl::StatusOr<PlacementResult> place_probes(const RayTracer& tracer, Receivers* receivers,
                                             const PlacementOptions& options, const Parallel& parallel);

/// A spacing that gives a level of these bounds about 200 cells, rounded to two significant digits so that small edits do
/// not change it.
float default_spacing(const Aabb& bounds);

}  // namespace lightloom
