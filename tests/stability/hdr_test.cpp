// Light is linear: all that is stored in fp16 is transport, and E scales with the lamps over twelve orders of magnitude.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

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
      check({Case::kHdr, text, worst, 1e-3}, [&] { return beside(*level, e, unit); });
    }
  }
}

}  // namespace
}  // namespace lightloom::stability
