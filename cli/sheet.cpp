#include "cli/sheet.h"

#include <algorithm>
#include <cmath>

#include "core/base/sampling.h"
#include "core/scene/srgb.h"

namespace lightloom {
namespace {

constexpr float kGain = 8;

template <class Value>
Image per_pixel(int width, int height, const Value& value) {
  Image out(width, height, {"R", "G", "B"});
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) out.set_rgb(x, y, value(x, y));
  }
  return out;
}

}  // namespace

absl::StatusOr<Image> make_sheet(Stage* stage, const Level& level, const Camera& camera, const SheetOptions& options,
                                 float* exposure) {
  // Path tracer and pictures look through the same points, so that edges do not count as errors: everything is made
  // at one sample per pixel of a larger picture.
  const int side = static_cast<int>(strata(options.samples));
  const int width = options.width * side;
  LL_ASSIGN_OR_RETURN(const Image direct_points, stage->picture(camera, {Layer::kDirect, width, 1}));
  LL_ASSIGN_OR_RETURN(const Image full_points, stage->picture(camera, {Layer::kFull, width, 1}));
  LL_ASSIGN_OR_RETURN(const Image albedo, stage->picture(camera, {Layer::kAlbedo, width, 1}));
  ReferenceOptions reference;
  reference.bounces = options.bounces;
  reference.samples = std::max(2, options.paths / (side * side));
  reference.parallel = options.parallel;
  LL_ASSIGN_OR_RETURN(const ReferenceResult truth, reference_camera(*level.tracer, camera, width, reference));
  const Image traced_points = per_pixel(width, direct_points.height, [&](int x, int y) {
    return direct_points.rgb(x, y) + albedo.rgb(x, y) * truth.image.rgb(x, y) / kPi;
  });

  const int height = direct_points.height / side;
  const auto shrink = [&](const Image& points) {
    return per_pixel(options.width, height, [&](int x, int y) {
      Vec3 sum;
      for (int k = 0; k < side * side; ++k) sum += points.rgb(x * side + k % side, y * side + k / side);
      return sum / static_cast<float>(side * side);
    });
  };
  Image direct = shrink(direct_points), full = shrink(full_points), traced = shrink(traced_points);
  *exposure = expose(&traced, *exposure);
  expose(&direct, *exposure);
  expose(&full, *exposure);
  const Image difference = per_pixel(options.width, height, [&](int x, int y) {
    const Vec3 a = full.rgb(x, y), b = traced.rgb(x, y);
    const auto amplify = [](float p, float q) {
      const auto shown = [](float c) { return to_srgb(std::clamp(c, 0.0f, 1.0f)); };
      return static_cast<float>(from_srgb(std::min(1.0f, kGain * std::abs(shown(p) - shown(q)))));
    };
    return Vec3{amplify(a.x, b.x), amplify(a.y, b.y), amplify(a.z, b.z)};
  });
  return per_pixel(2 * options.width, 2 * height, [&](int x, int y) {
    const Image& panel = y < height ? (x < options.width ? direct : full) : (x < options.width ? traced : difference);
    return panel.rgb(x % options.width, y % height);
  });
}

}  // namespace lightloom
