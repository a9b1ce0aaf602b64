// Infinite bounces: each frame of feedback adds one. Energy that a bounce gains or loses is multiplied by 1 ÷ (1 − albedo).
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

/// Frames after which less than 1e-4 is missing.
int frames(float albedo) { return static_cast<int>(std::ceil(std::log(1e-4) / std::log(albedo))); }

std::string percent(float albedo) { return std::to_string(std::lround(100 * albedo)) + " %"; }

class StabilityFurnace : public ::testing::TestWithParam<float> {};

// Every wall emits radiance L and reflects a: L_out = L + a·L_out, so E = π·L ÷ (1 − a) everywhere.
TEST_P(StabilityFurnace, EveryReceiverReachesTheClosedForm) {
  const float a = GetParam();
  const auto level = bake_at(test::furnace(a, 1), 1, 4);
  const Field expected(level->elements.receivers.all.size(), Vec3{1, 1, 1} * (kPi / (1 - a)));
  for (const Device device : {Device::kSimd, Device::kVulkan}) {
    const Field e = relight(*level, frames(a), 16, device);
    double worst = 0;
    for (size_t i = 0; i < e.size(); ++i) {
      worst = std::max(worst, static_cast<double>(std::abs(e[i].x / expected[i].x - 1)));
    }
    check({Case::kFeedback,
           "largest |E ÷ closed form − 1|, furnace, albedo " + percent(a) +
               (device == Device::kVulkan ? ", Vulkan" : ", SIMD"),
           worst, 0.02},
          [&] { return beside(*level, e, expected); });
  }
}
INSTANTIATE_TEST_SUITE_P(Albedo, StabilityFurnace, ::testing::Values(0.5f, 0.9f, 0.99f),
                         [](const auto& info) { return std::to_string(std::lround(1000 * info.param)); });

class StabilityLampInABox : public ::testing::TestWithParam<float> {};

// A lamp in a closed box whose walls all reflect a: of its power Φ = 4π·I every bounce keeps the share a, whatever the
// shape, so ∫E dA = Φ·a ÷ (1 − a). And adding light, frame by frame, must never take it away or overshoot.
TEST_P(StabilityLampInABox, EnergyIsTheGeometricSum) {
  const float a = GetParam();
  std::array<test::Wall, 6> walls;
  walls.fill({{a, a, a}, {}});
  Scene scene = test::closed_box({4, 3, 4}, walls);
  test::add_point_light(&scene, {1, 2, 1.2f}, 10);
  const auto level = bake_at(std::move(scene), 1, 4);
  double surface = 0;
  for (size_t i = 0; i < level->elements.receivers.all.size(); ++i) surface += area(*level, i);
  const double expected = 4 * kPi * 10 * static_cast<double>(a / (1 - a));
  const int n = frames(a);
  const Field half = relight(*level, n / 2, 256), e = relight(*level, n, 256), twice = relight(*level, 2 * n, 256);
  const double power = surface * mean(*level, e), later = surface * mean(*level, twice);
  EXPECT_GT(power, surface * mean(*level, half));
  check({Case::kFeedback, "|∫E dA ÷ analytic sum − 1|, lamp in a box, albedo " + percent(a),
         std::abs(power / expected - 1), 0.02},
        [&] {
          float exposure = 0;
          return picture(*level, e, {}, &exposure);
        });
  check({Case::kFeedback, "growth when the frames are doubled, lamp in a box, albedo " + percent(a), later / power - 1,
         0.005});
}
INSTANTIATE_TEST_SUITE_P(Albedo, StabilityLampInABox, ::testing::Values(0.5f, 0.8f, 0.95f, 0.99f),
                         [](const auto& info) { return std::to_string(std::lround(1000 * info.param)); });

}  // namespace
}  // namespace lightloom::stability
