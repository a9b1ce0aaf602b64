// Places objects' lightmaps in one image, keeping earlier places.
#pragma once

#include <map>
#include <vector>

#include "core/base/hash.h"
#include "core/base/status.h"
#include "core/receivers/layout.h"
#include "core/receivers/rect_packing.h"

namespace lightloom {

struct PlacedImage {
  int width = 0, height = 0;
  std::vector<Placement> placements;
};

/// One texel at least between any two rectangles. Those of size 0 are ignored and placed at (0,0). Earlier
/// places are kept as LayoutOptions says. Errors: a rectangle wider than the earlier image; an image over
/// max_size.
absl::StatusOr<PlacedImage> place_objects(const std::vector<RectSize>& sizes, const std::vector<Digest>& ids,
                                          const LayoutOptions& options, int max_size);

}  // namespace lightloom
