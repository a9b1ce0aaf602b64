// What of an earlier bake still holds after an edit, and what may not: by keys and traces, so by proof (docs/adr/0006).
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/bake/bake_traces.h"
#include "core/bake/plan.h"

namespace lightloom {

/// What is known of one result of a plan.
struct ReuseItem {
  static constexpr uint32_t kNone = 0xffffffffu;
  enum Why : uint8_t {
    kHolds,    ///< the earlier result: the same would come out, or what may differ is within the tolerance
    kCrossed,  ///< rays crossed a cell of the world that has changed
    kUnknown,  ///< no earlier result is of the same receivers, probes and parameters
  };
  Why why = kUnknown;
  uint32_t earlier = kNone;  ///< its index in BakeTraces, unless kUnknown
  /// Of its rays, that crossed what has changed since it was baked: how much of its light may be another. 1 if that is not
  /// known. Above 0 although it holds: it is kept stale.
  double share = 1;
};

struct Reuse {
  std::vector<ReuseItem> cells;   ///< by Plan::cells
  std::vector<ReuseItem> probes;  ///< by PlacementResult::probes: their relight sets
};

/// Of a bake that nothing went before.
Reuse no_reuse(const Plan& plan);

/// `now`: contents of the plan's world. `tolerance`: the share up to which cells are kept although they may have changed; a
/// later look back with less finds them. Never kept so is what may name texels that are no more: relight sets, which are
/// cheap, and cells whose near fields reached a texel that is gone. Error: cancellation.
absl::StatusOr<Reuse> find_reuse(const Plan& plan, const Scene& scene, const WorldContents& now,
                                 const BakeTraces& earlier, double tolerance, const Parallel& parallel);

/// Indices of those that do not hold, the largest share first, and in the plan's order among equals.
std::vector<uint32_t> dirty_first(std::span<const ReuseItem> items);

}  // namespace lightloom
