#include "cli/player.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

TEST(Player, TheRuntimeWithoutADeviceEqualsTheDecoder) {
  BakeParams params;
  params.texels_per_metre = 2;
  params.rays = 36;
  params.relight_rays = 256;
  const auto level = test::bake_level(*builtin_scene("cornell"), params);
  const std::vector<Vec3> simd = test::light(*level, 4, test::Device::kSimd);
  const std::vector<Vec3> decoder = test::light(*level, 4, test::Device::kCpu);
  ASSERT_EQ(simd.size(), decoder.size());
  double sum = 0, worst = 0;
  for (size_t i = 0; i < simd.size(); ++i) {
    for (int c = 0; c < 3; ++c) {
      sum += static_cast<double>(decoder[i][c]);
      worst = std::max(worst, std::abs(static_cast<double>(simd[i][c]) - static_cast<double>(decoder[i][c])));
    }
  }
  const double mean = sum / (3 * static_cast<double>(simd.size()));
  EXPECT_GT(mean, 0);
  EXPECT_LT(worst, 1e-4 * mean);
}

}  // namespace
}  // namespace lightloom
