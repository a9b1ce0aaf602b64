// Skyline packing by stb_rect_pack, tried at several widths.
#include "core/receivers/rect_packing.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "core/base/check.h"

namespace {

// The order of equal rectangles must not depend on the C library's qsort.
template <class T>
void stable_order(T* base, size_t count, int (*compare)(const void*, const void*)) {
  std::stable_sort(base, base + count, [compare](const T& a, const T& b) { return compare(&a, &b) < 0; });
}

}  // namespace

#define STBRP_SORT(base, count, size, compare) stable_order(base, static_cast<size_t>(count), compare)
#define STBRP_ASSERT LL_CHECK
#define STBRP_STATIC
#define STB_RECT_PACK_IMPLEMENTATION
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wunused-function"
#include <stb/stb_rect_pack.h>
#pragma GCC diagnostic pop

namespace lightloom {

std::optional<Packing> pack_strip(std::span<const RectSize> sizes, int gutter, int width, int max_height) {
  std::vector<stbrp_rect> rects(sizes.size());
  for (size_t i = 0; i < sizes.size(); ++i) {
    rects[i].w = sizes[i].width + gutter;
    rects[i].h = sizes[i].height + gutter;
  }
  // The last column and row of gutter may hang over the border.
  std::vector<stbrp_node> nodes(static_cast<size_t>(width + gutter));
  stbrp_context context;
  stbrp_init_target(&context, width + gutter, max_height + gutter, nodes.data(), static_cast<int>(nodes.size()));
  if (!stbrp_pack_rects(&context, rects.data(), static_cast<int>(rects.size()))) return std::nullopt;

  Packing packing{width, 0, std::vector<RectPosition>(sizes.size())};
  for (size_t i = 0; i < sizes.size(); ++i) {
    packing.positions[i] = {rects[i].x, rects[i].y};
    packing.height = std::max(packing.height, rects[i].y + sizes[i].height);
  }
  return packing;
}

std::optional<Packing> pack_near_square(std::span<const RectSize> sizes, int gutter, int max_size) {
  int64_t area = 0;
  int widest = 1;
  for (const RectSize& s : sizes) {
    area += int64_t{s.width + gutter} * (s.height + gutter);
    widest = std::max(widest, s.width);
  }
  const double side = std::sqrt(static_cast<double>(area));
  if (widest > max_size || side > 2.0 * max_size) return std::nullopt;

  // A try costs about rectangles × skyline; a good width matters less the more there are.
  const int tries = static_cast<int>(std::clamp<int64_t>(200'000 / std::max<int64_t>(1, std::ssize(sizes)), 1, 64));
  std::optional<Packing> best;
  // The area, a little more for what is far from square.
  const auto score = [](const Packing& p) {
    const int64_t w = p.width, h = p.height;
    const bool long_and_thin = std::max(w, h) >= 4 * std::min(w, h);
    return std::pair(long_and_thin, 25 * w * h + (w - h) * (w - h));
  };
  int previous = 0;
  for (int i = 0; i < tries; ++i) {
    const int width = std::min(max_size, std::max(widest, static_cast<int>(side * (0.6 + 1.2 * (i + 0.5) / tries))));
    if (width == previous) continue;
    previous = width;
    std::optional<Packing> packing = pack_strip(sizes, gutter, width, max_size);
    if (!packing) continue;
    int used = 0;
    for (size_t k = 0; k < sizes.size(); ++k) used = std::max(used, packing->positions[k].x + sizes[k].width);
    packing->width = used;
    if (!best || score(*packing) < score(*best)) best = std::move(packing);
  }
  return best;
}

}  // namespace lightloom
