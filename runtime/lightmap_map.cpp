#include "runtime/lightmap_map.h"

#include <algorithm>

#include "runtime/shaders/layout.h"

namespace lightloom {
namespace {

constexpr int kDilation = 2;
constexpr uint8_t kNothing = 255;

}  // namespace

LightmapMap::LightmapMap(uint32_t width, uint32_t height, std::span<uint32_t> map, std::pmr::memory_resource* memory)
    : width_(width), height_(height), map_(map), distance_(map.size(), kNothing, memory) {}

/// The nearest valid texel is shown, of equals the one of the lowest element.
void LightmapMap::claim(uint64_t texel, uint32_t element, uint8_t distance) {
  const uint32_t shown = map_[texel] & ~gpu::kDilated;
  if (distance > distance_[texel] || (distance == distance_[texel] && element >= shown)) return;
  distance_[texel] = distance;
  map_[texel] = distance == 0 ? element : element | gpu::kDilated;
}

LightmapMap::Range LightmapMap::add(const AssetIndex::Object& o, std::span<const uint32_t> keys) {
  Range changed{map_.size(), 0};
  for (size_t i = 0; i < keys.size(); ++i) {
    const uint32_t texels = o.width * o.height, in_side = keys[i] % texels;
    const int x = static_cast<int>(o.x + in_side % o.width), y = static_cast<int>(o.y + in_side / o.width);
    const uint64_t layer = keys[i] / texels;
    for (int dy = -kDilation; dy <= kDilation; ++dy) {
      for (int dx = -kDilation; dx <= kDilation; ++dx) {
        if (x + dx < 0 || y + dy < 0 || x + dx >= static_cast<int>(width_) || y + dy >= static_cast<int>(height_)) {
          continue;
        }
        const uint64_t at = (layer * height_ + static_cast<uint64_t>(y + dy)) * width_ + static_cast<uint64_t>(x + dx);
        claim(at, o.first_element + static_cast<uint32_t>(i), static_cast<uint8_t>(dx * dx + dy * dy));
        changed.begin = std::min(changed.begin, at);
        changed.end = std::max(changed.end, at + 1);
      }
    }
  }
  return changed;
}

}  // namespace lightloom
