// What can be seen from where: the relight rays of the probes around a point end at what is visible from about there.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "runtime/asset_index.h"

namespace lightloom {

class Sight {
 public:
  explicit Sight(const AssetIndex& index);

  /// The surface elements of a cell's receivers.
  void add_cell(uint32_t cell, std::span<const uint32_t> elements);
  /// A probe's rays: surface elements, RelightChunk::kDead or kSky.
  void add_probe(uint32_t probe, std::span<const uint32_t> rays);

  /// Per cell: about the share of all directions in which it is seen from `eye`; and a little for each cell that is near,
  /// as long as no rays are known, or behind what hides it now. Sums to about 1.
  std::vector<float> importance(Vec3 eye) const;

 private:
  const AssetIndex& index_;
  std::vector<uint32_t> cell_of_;            ///< per surface element
  std::vector<std::vector<uint32_t>> rays_;  ///< per probe; empty: not known
};

}  // namespace lightloom
