#include "core/scene/picture.h"

#include <cmath>

namespace lightloom {

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
