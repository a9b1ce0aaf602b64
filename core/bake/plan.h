// What a bake will do, from the scene alone: receivers, probes, and the bake cells that split the work.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/asset/manifest.h"
#include "core/base/parallel.h"
#include "core/probes/placement.h"
#include "core/receivers/layout.h"
#include "core/receivers/receivers.h"
#include "core/scene/ray_tracer.h"
#include "core/trace/world_grid.h"

namespace lightloom {

/// Names a stage, how far it is and how many rays it has shot (0 where that is not counted); called from worker threads,
/// one call at a time.
using StageProgress = std::function<void(const std::string& stage, uint64_t done, uint64_t total, uint64_t rays)>;

struct BakeControl {
  int threads = 0;  ///< 0: one per hardware thread
  const CancelFlag* cancel = nullptr;
  StageProgress progress;

  Parallel stage(const std::string& name) const;
};

/// A world octree cell with fewer receivers than BakeParams::cell_receivers: one task.
struct PlannedCell {
  int32_t level = 0;  ///< covers [i, i+1)·cell_side()
  GridCell cell{};
  std::vector<uint32_t> receivers;  ///< indices into Receivers::all, sorted by (object id, key)
};

struct Plan {
  BakeParams params;  ///< with nothing left to choose
  AtlasLayout layout;
  Receivers receivers;
  PlacementResult placement;
  std::vector<PlannedCell> cells;
  WorldGrid grid;                                    ///< by which traces are kept
  double seconds_receivers = 0, seconds_probes = 0;  ///< that finding them took
};

/// Probes that a receiver may read besides its k links: the one that sets the support radius, and fallbacks.
inline constexpr int kFallbacks = 16;
/// How far the near field of a receiver reaches by default, in spacings of probes. A probe blurs what it sees by some 20°, at any
/// distance from the receiver; what stands next to the receiver fills much of its view, and is blurred just as much. ADR 0008 has
/// what other shares cost.
inline constexpr float kNearField = 0.5f;

/// Whether the numbers are in range; make_plan checks them too.
absl::Status check_params(const BakeParams& request);

/// Errors: parameters out of range, a scene without receivers, cancellation.
absl::StatusOr<Plan> make_plan(const RayTracer& tracer, const BakeParams& request, const BakeControl& control);

/// The first half of make_plan: a plan with receivers and a grid, and neither probes nor cells. Its spacing may be changed before
/// the other half.
absl::StatusOr<Plan> find_ground(const RayTracer& tracer, const BakeParams& request, const BakeControl& control);
/// The other half.
absl::StatusOr<Plan> finish_plan(const RayTracer& tracer, Plan ground, const BakeControl& control);

/// Everything in the scene that the transport depends on: geometry, alpha masks, sidedness, what receives; not
/// albedo, emission or lights.
Digest scene_hash(const Scene& scene);

}  // namespace lightloom
