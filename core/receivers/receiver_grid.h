// From a point that a ray hit to the receiver that stands for it.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/receivers/receivers.h"

namespace lightloom {

/// Receivers by where they lie. Keeps references to its arguments.
class ReceiverGrid {
 public:
  ReceiverGrid(const Scene& scene, const AtlasLayout& layout, const Receivers& receivers);

  /// The receiver of the texel that the hit falls in, if it looks the same way from about the same place. A texel that
  /// several small charts share has one receiver for all, and texels in solids and dark cavities have none: then the
  /// nearest one that looks the same way, the hit's own object before others, within eight texels. Else
  /// Receivers::kNone.
  uint32_t locate(const Hit& hit) const;

 private:
  using Cell = std::array<int32_t, 3>;
  struct Entry {
    Cell cell;
    uint32_t receiver;
  };
  Cell cell_of(Vec3 p) const;

  const Scene& scene_;
  const AtlasLayout& layout_;
  const Receivers& receivers_;
  float side_ = 1;              ///< of a cell, metres
  std::vector<Entry> entries_;  ///< by cell, then receiver
};

}  // namespace lightloom
