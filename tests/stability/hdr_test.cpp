// Light is linear: all that is stored in fp16 is transport, and E scales with the lamps over twelve orders of magnitude.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"
#include "tests/unit/runtime/test_engine.h"

namespace lightloom::stability {
namespace {

TEST(StabilityHdr, EScalesWithTheLamps) {
  Scene scene = test::closed_box({4, 3, 4}, {{{{0.8f, 0.8f, 0.8f}, {}}, {}, {{0.7f, 0.1f, 0.1f}, {}}, {}, {}, {}}});
  test::add_point_light(&scene, {1, 2, 1.2f}, 1);
  scene.environment = {0.5f, 0.5f, 0.5f};
  const auto level = bake_at(std::move(scene), 1.5f, 4);
  for (const Device device : {Device::kSimd, Device::kVulkan}) {
    const Field unit = relight(*level, 8, 16, device);
    const double scale = mean(*level, unit);
    for (const float factor : {1e-6f, 1e-3f, 1e3f, 1e6f}) {
      level->scene->lights[0].intensity = factor;
      level->scene->environment = Vec3{0.5f, 0.5f, 0.5f} * factor;
      Field e = relight(*level, 8, 16, device);
      level->scene->lights[0].intensity = 1;
      level->scene->environment = {0.5f, 0.5f, 0.5f};
      double worst = 0;
      for (size_t i = 0; i < e.size(); ++i) {
        e[i] = e[i] / factor;
        for (int c = 0; c < 3; ++c)
          worst = std::max(worst, static_cast<double>(std::abs(e[i][c] - unit[i][c])) / scale);
      }
      char text[96];
      std::snprintf(text, sizeof text, "largest |E(%.0e·light) ÷ %.0e − E| ÷ mean E, %s", static_cast<double>(factor),
                    static_cast<double>(factor), device == Device::kVulkan ? "Vulkan" : "SIMD");
      const bool extreme = factor == 1e-6f || factor == 1e6f;
      check({Case::kHdr, text, worst, 1e-3},
            extreme ? std::function<Image()>([&] { return beside(*level, e, unit); }) : nullptr);
    }
  }
}

/// How far E in the image of the format, its exposure undone, is from E in the buffer, under random light times `factor`:
/// the largest share of the greatest |E|; infinite where the image is not finite.
double image_error(VkFormat format, float factor, float exposure) {
  lightloom::testing::SyntheticAsset asset = lightloom::testing::random_asset({});
  asset.lay_out_in_a_row(24);
  lightloom::testing::Engine engine(format);
  engine.load(asset);
  SurfaceLight light = lightloom::testing::random_light(engine.outputs().surface_elements, 3);
  for (auto* field : {&light.direct, &light.emission}) {
    for (Vec3& v : *field) v *= factor;
  }
  light.environment *= factor;
  engine.light(light);
  lightloom_frame_info info{};
  info.struct_size = sizeof info;
  info.image_exposure = exposure;
  engine.frame(&info);
  const std::vector<float> image = engine.read_image();
  const std::vector<Vec3> e = engine.read_vec3(engine.outputs().irradiance);
  float greatest = 0;
  for (const Vec3 v : e) greatest = std::max({greatest, std::abs(v.x), std::abs(v.y), std::abs(v.z)});
  EXPECT_GT(greatest, 0);
  double worst = 0;
  size_t element = 0;
  for (const ObjectEntry& o : asset.manifest.objects) {
    const SurfaceChunk surface = value_or_die(decode_surface(asset.chunks.at(o.surface.digest)));
    for (const uint32_t key : surface.keys) {
      const uint32_t n = static_cast<uint32_t>(o.width * o.height), w = static_cast<uint32_t>(o.width);
      const size_t row = key / n * 24 + key % n / w, column = static_cast<uint32_t>(o.x) + key % n % w;
      const float* texel = &image[4 * (row * static_cast<uint32_t>(asset.manifest.width) + column)];
      for (int c = 0; c < 3; ++c) {
        worst = std::isfinite(texel[c])
                    ? std::max(worst, static_cast<double>(std::abs(texel[c] / exposure - e[element][c]) / greatest))
                    : std::numeric_limits<double>::infinity();
        if (!std::isfinite(worst)) return worst;
      }
      ++element;
    }
  }
  return worst;
}

TEST(StabilityHdr, ImagesOfE) {
  for (const float factor : {1e-6f, 1.0f, 1e6f}) {
    char text[96];
    std::snprintf(text, sizeof text, "largest error of E as an fp32 image ÷ greatest E, light %.0e",
                  static_cast<double>(factor));
    check({Case::kHdr, text, image_error(VK_FORMAT_R32G32B32A32_SFLOAT, factor, 1), 1e-3});
  }
  // fp16 goes from 6e-8 to 65504: beyond 1e-3 and 1e3, engines expose the image.
  for (const float factor : {1e-6f, 1e-3f, 1.0f, 1e3f, 1e6f}) {
    const bool extreme = factor == 1e-6f || factor == 1e6f;
    char text[96];
    std::snprintf(text, sizeof text, "largest error of E as an fp16 image ÷ greatest E, light %.0e%s",
                  static_cast<double>(factor), extreme ? ", exposed" : "");
    check({Case::kHdr, text, image_error(VK_FORMAT_R16G16B16A16_SFLOAT, factor, extreme ? 1 / factor : 1), 1e-3});
  }
}

}  // namespace
}  // namespace lightloom::stability
