// Which surface element each texel of the lightmap image shows: the valid texels, and around them two more so that
// bilinear filtering at a chart's border reads no black.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <span>
#include <vector>

#include "runtime/asset_index.h"

namespace lightloom {

/// Layer 0 shows fronts, layer 1 backs.
inline constexpr uint32_t kImageLayers = 2;

/// The map after any objects are added does not depend on their order.
class LightmapMap {
 public:
  /// `map` has kImageLayers × height × width entries, all gpu::kNoElement; it is written by add().
  LightmapMap(uint32_t width, uint32_t height, std::span<uint32_t> map, std::pmr::memory_resource* memory);

  /// Range of `map` that may have changed.
  struct Range {
    uint64_t begin, end;
  };
  Range add(const AssetIndex::Object& object, std::span<const uint32_t> keys);

 private:
  void claim(uint64_t texel, uint32_t element, uint8_t distance);

  uint32_t width_, height_;
  std::span<uint32_t> map_;
  std::pmr::vector<uint8_t> distance_;  ///< squared, to the valid texel that is shown
};

}  // namespace lightloom
