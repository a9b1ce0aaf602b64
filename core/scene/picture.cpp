#include "core/scene/picture.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/text.h"

namespace lightloom {

absl::StatusOr<int> image_height(const Camera& camera, int width) {
  constexpr double kMaxHeight = 16384;
  const double height = std::round(static_cast<double>(width) / static_cast<double>(camera.aspect));
  if (height <= kMaxHeight) return std::max(1, static_cast<int>(height));
  return absl::InvalidArgumentError("camera '" + printable(camera.name) + "' is so narrow that a picture of width " +
                                    std::to_string(width) +
                                    " would have more than 16384 rows; mend its aspectRatio or lower --width");
}

float expose(Image* image, float factor) {
  if (factor <= 0) {
    double sum = 0, count = 0;
    for (int y = 0; y < image->height; ++y) {
      for (int x = 0; x < image->width; ++x) {
        const float luminance = dot(image->rgb(x, y), {0.2126f, 0.7152f, 0.0722f});
        if (luminance > 0) sum += std::log(luminance), count += 1;
      }
    }
    factor = count > 0 ? static_cast<float>(0.18 / std::exp(sum / count)) : 1;
  }
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const Vec3 v = image->rgb(x, y) * factor;
      const auto map = [](float c) { return c * (1 + c / 16) / (1 + c); };
      image->set_rgb(x, y, {map(v.x), map(v.y), map(v.z)});
    }
  }
  return factor;
}

}  // namespace lightloom
