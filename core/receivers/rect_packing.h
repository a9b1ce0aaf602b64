// Packs rectangles into an image.
#pragma once

#include <optional>
#include <span>
#include <vector>

namespace lightloom {

struct RectSize {
  int width = 0, height = 0;
};
struct RectPosition {
  int x = 0, y = 0;
};

struct Packing {
  int width = 0, height = 0;
  std::vector<RectPosition> positions;  ///< as the sizes given
};

/// Into an image `width` wide, as low as it gets, `gutter` texels between any two. Nothing if one is too wide
/// or the image would be higher than max_height.
std::optional<Packing> pack_strip(std::span<const RectSize> sizes, int gutter, int width, int max_height);

/// Into the smallest image found whose sides differ by a factor below four, unless one rectangle forces more.
/// Nothing if a side would exceed max_size.
std::optional<Packing> pack_near_square(std::span<const RectSize> sizes, int gutter, int max_size);

}  // namespace lightloom
