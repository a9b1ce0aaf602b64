// From a point that a ray hit to the receiver that stands for it. What lies behind a wall never does: light would leak.
#pragma once

#include <memory>
#include <vector>

#include "core/receivers/receivers.h"

namespace lightloom {

/// Receivers by where they lie (a k-d tree). Keeps references to its arguments.
class ReceiverSearch {
 public:
  ReceiverSearch(const RayTracer& tracer, const AtlasLayout& layout, const Receivers& receivers);
  ~ReceiverSearch();

  /// The receiver of the texel that the hit falls in, if it looks the same way from about the same place, and nothing
  /// stands between. A texel that several small charts share has one receiver for all, one that a door cuts through has
  /// one side's, and texels in solids and dark cavities have none: then of the eight nearest that look the same way, the
  /// hit's own object before others, within eight texels, the first that is not behind a wall; else the texel's own, if
  /// any, else Receivers::kNone. `reach`, if any, becomes a distance from the hit, metres: receivers and geometry farther away had
  /// no say.
  uint32_t locate(const Hit& hit, float* reach = nullptr) const;

 private:
  struct Tree;
  float texel_of(uint32_t object, uint32_t triangle) const;

  const RayTracer& tracer_;
  const Scene& scene_;
  const AtlasLayout& layout_;
  const Receivers& receivers_;
  std::vector<float> texels_;  ///< per object: metres per texel over all of it
  std::unique_ptr<Tree> tree_;
};

}  // namespace lightloom
