#include "core/receivers/placement.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <optional>
#include <tuple>

namespace lightloom {
namespace {

constexpr int kGutter = 1;
// Work limit of the search for holes, in comparisons of rectangles; beyond it, new objects go below the
// others.
constexpr uint64_t kHoleSearch = uint64_t{1} << 30;

struct Rect {
  int x = 0, y = 0, width = 0, height = 0;
};

/// True if they are closer than the gutter.
bool touch(const Rect& a, const Rect& b) {
  return a.x < b.x + b.width + kGutter && b.x < a.x + a.width + kGutter && a.y < b.y + b.height + kGutter &&
         b.y < a.y + a.height + kGutter;
}

/// First-fit in the free space of a fixed area: the topmost place, of those the leftmost, among places that
/// lie below and right of others. `placed` is kept sorted by x.
class HoleFinder {
 public:
  HoleFinder(int width, int height, std::vector<Rect> placed)
      : width_(width), height_(height), placed_(std::move(placed)) {
    std::sort(placed_.begin(), placed_.end(), by_x);
  }

  std::optional<Placement> find(RectSize size) {
    std::vector<int> rows{0};
    for (const Rect& r : placed_) rows.push_back(r.y + r.height + kGutter);
    std::sort(rows.begin(), rows.end());
    rows.erase(std::unique(rows.begin(), rows.end()), rows.end());
    for (int y : rows) {
      if (y + size.height > height_ || work_ > kHoleSearch) break;
      work_ += placed_.size();
      Rect r{0, y, size.width, size.height};
      // Pushed right by every rectangle in its way, from the left.
      for (const Rect& other : placed_) {
        if (touch(r, other)) r.x = other.x + other.width + kGutter;
      }
      if (r.x + r.width > width_) continue;
      placed_.insert(std::upper_bound(placed_.begin(), placed_.end(), r, by_x), r);
      return Placement{r.x, r.y};
    }
    return std::nullopt;
  }

 private:
  static bool by_x(const Rect& a, const Rect& b) { return std::tie(a.x, a.y) < std::tie(b.x, b.y); }

  const int width_, height_;
  std::vector<Rect> placed_;
  uint64_t work_ = 0;
};

}  // namespace

absl::StatusOr<PlacedImage> place_objects(const std::vector<RectSize>& sizes, const std::vector<Digest>& ids,
                                          const LayoutOptions& options, int max_size) {
  PlacedImage image{options.earlier_width, options.earlier_height, std::vector<Placement>(sizes.size())};
  const bool fresh = options.earlier_width <= 0 || options.earlier_height <= 0;
  if (fresh) image.width = image.height = 0;
  const auto too_large = [&] {
    return absl::InvalidArgumentError(absl::StrCat("lightmaps of all objects do not fit ", max_size, " x ", max_size,
                                                   " texels; lower the texels per metre"));
  };
  if (image.width > max_size || image.height > max_size) return too_large();

  // Keep what is there and unchanged.
  std::vector<Rect> kept;
  std::vector<size_t> waiting;
  for (size_t i = 0; i < sizes.size(); ++i) {
    if (sizes[i].width <= 0 || sizes[i].height <= 0) continue;
    const auto it = options.earlier.find(ids[i]);
    if (!fresh && it != options.earlier.end() && it->second.width == sizes[i].width &&
        it->second.height == sizes[i].height) {
      const Placement p = it->second.placement;
      const Rect r{p.x, p.y, sizes[i].width, sizes[i].height};
      // Earlier layouts come from a file: a place outside the image or taken twice is no place.
      if (p.x >= 0 && p.y >= 0 && p.x <= image.width - r.width && p.y <= image.height - r.height &&
          std::none_of(kept.begin(), kept.end(), [&](const Rect& k) { return touch(r, k); })) {
        kept.push_back(r);
        image.placements[i] = p;
        continue;
      }
    }
    waiting.push_back(i);
  }

  // Fill holes, large objects first.
  std::stable_sort(waiting.begin(), waiting.end(), [&](size_t a, size_t b) {
    return std::tie(sizes[b].height, sizes[b].width) < std::tie(sizes[a].height, sizes[a].width);
  });
  int bottom = 0;
  if (!fresh) {
    HoleFinder holes(image.width, image.height, kept);
    std::erase_if(waiting, [&](size_t i) {
      const std::optional<Placement> place = holes.find(sizes[i]);
      if (place) image.placements[i] = *place;
      return place.has_value();
    });
    bottom = image.height + kGutter;
  }
  if (waiting.empty()) return image;

  // Pack the rest: as the whole image, or as a strip below.
  std::vector<RectSize> rest;
  for (size_t i : waiting) rest.push_back(sizes[i]);
  for (const RectSize& size : rest) {
    if (!fresh && size.width > image.width) {
      return absl::FailedPreconditionError(absl::StrCat("a new object's lightmap is ", size.width,
                                                        " texels wide and the earlier image only ", image.width,
                                                        "; lower its texel scale or bake without the earlier layout"));
    }
  }
  const std::optional<Packing> packing = fresh               ? pack_near_square(rest, kGutter, max_size)
                                         : bottom < max_size ? pack_strip(rest, kGutter, image.width, max_size - bottom)
                                                             : std::nullopt;
  if (!packing) return too_large();
  for (size_t k = 0; k < waiting.size(); ++k) {
    image.placements[waiting[k]] = {packing->positions[k].x, bottom + packing->positions[k].y};
  }
  if (fresh) image.width = packing->width;
  image.height = bottom + packing->height;
  return image;
}

}  // namespace lightloom
