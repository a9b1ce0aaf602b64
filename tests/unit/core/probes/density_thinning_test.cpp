#include "core/probes/density_thinning.h"

#include <gtest/gtest.h>

#include "core/base/rng.h"
#include "core/probes/links.h"

namespace lightloom {
namespace {

std::vector<Vec3> random_points(size_t count, uint64_t seed) {
  Rng rng(seed);
  std::vector<Vec3> out;
  for (size_t i = 0; i < count; ++i) {
    const float x = rng.next_float(), y = rng.next_float();
    out.push_back({x, y, rng.next_float()});
  }
  return out;
}

/// As the paper says it: look for the densest point, take it away, start again.
std::vector<Vec3> thin_by_the_book(std::vector<Vec3> points, float radius, size_t count) {
  while (points.size() > count) {
    size_t densest = 0;
    double most = -1;
    for (size_t i = 0; i < points.size(); ++i) {
      double density = 0;
      for (const Vec3 q : points) density += static_cast<double>(spatial_weight(length(points[i] - q) / radius));
      if (density > most + 1e-9) most = density, densest = i;
    }
    points.erase(points.begin() + static_cast<std::ptrdiff_t>(densest));
  }
  return points;
}

TEST(DensityThinning, AsByTheBook) {
  for (const float radius : {0.1f, 0.4f, 3.0f}) {
    const auto points = random_points(120, 7);
    EXPECT_EQ(thin_by_density(points, radius, 30), thin_by_the_book(points, radius, 30)) << radius;
  }
}

TEST(DensityThinning, ClumpsGoFirst) {
  // A hundred points in a corner, and eight far from each other.
  std::vector<Vec3> points;
  for (const Vec3 p : random_points(100, 1)) points.push_back(p * 0.1f);
  for (int i = 1; i <= 8; ++i) points.push_back({static_cast<float>(3 * i), 0, 0});
  const auto left = thin_by_density(points, 1, 9);
  ASSERT_EQ(left.size(), 9u);
  EXPECT_LT(left[0].x, 0.1f);
  for (size_t i = 1; i < 9; ++i) EXPECT_EQ(left[i].x, static_cast<float>(3 * i));
}

TEST(DensityThinning, FewPointsStay) {
  const auto points = random_points(5, 2);
  EXPECT_EQ(thin_by_density(points, 1, 5), points);
  EXPECT_EQ(thin_by_density(points, 1, 50), points);
  EXPECT_TRUE(thin_by_density({}, 1, 3).empty());
}

}  // namespace
}  // namespace lightloom
