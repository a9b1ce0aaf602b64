// A lamp on its way must not make the light flicker: the rms second difference of E − truth along a smooth path, over mean
// E. The truth takes the same random numbers in each frame, so that its own noise moves as little as it can.
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

constexpr int kFrames = 200;

/// Once around the crate, rising and sinking: 8.9 m in 200 frames.
Vec3 lamp_at(int frame) {
  const float t = 2 * kPi * static_cast<float>(frame) / kFrames;
  return {1.9f + 1.4f * std::cos(t), 1.8f + 0.5f * std::sin(2 * t), 1.9f + 1.4f * std::sin(t)};
}

/// Area-weighted rms over the elements and frames of e[t+1] − 2·e[t] + e[t−1].
double second_difference(const BakedLevel& level, const std::vector<Field>& e) {
  double sum = 0, weight = 0;
  for (size_t t = 1; t + 1 < e.size(); ++t) {
    for (size_t i = 0; i < e[t].size(); ++i) {
      const Vec3 d = e[t + 1][i] - 2 * e[t][i] + e[t - 1][i];
      sum += area(level, i) * static_cast<double>(dot(d, d)) / 3;
      weight += area(level, i);
    }
  }
  return std::sqrt(sum / weight);
}

TEST(StabilityMovingLight, DoesNotFlicker) {
  Scene scene = test::room_with_crate();
  test::add_point_light(&scene, lamp_at(0), 10);
  const auto level = bake_at(std::move(scene), 1.5f, 2.5f);
  std::vector<Field> own, traced, error;
  double sum = 0;
  for (int frame = 0; frame < kFrames; ++frame) {
    level->scene->lights[0].position = lamp_at(frame);
    own.push_back(relight(*level, 1));
    traced.push_back(truth_field(*level, trace_truth(*level, 1, 128), own.back()));
    error.push_back(own.back());
    for (size_t i = 0; i < own.back().size(); ++i) error.back()[i] = own.back()[i] - traced.back()[i];
    sum += mean(*level, own.back());
  }
  const double mean_e = sum / kFrames;
  std::printf("second differences ÷ mean E: E %.4f, truth %.4f, E − truth %.4f\n",
              second_difference(*level, own) / mean_e, second_difference(*level, traced) / mean_e,
              second_difference(*level, error) / mean_e);
  check(
      {Case::kMovingLight, "flicker, lamp around a crate, 200 frames", second_difference(*level, error) / mean_e, 0.01},
      [&] { return beside(*level, own.back(), traced.back()); });
}

}  // namespace
}  // namespace lightloom::stability
