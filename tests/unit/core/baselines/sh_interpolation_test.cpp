#include "core/baselines/sh_interpolation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/core/baselines/planned_level.h"

namespace lightloom {
namespace {

using test::PlannedLevel;
using test::value_or_die;

std::unique_ptr<Baseline> sh(const PlannedLevel& level, int order) {
  return value_or_die(make_sh_interpolation(*level.tracer, level.plan, order, {}));
}

// Every wall emits L and reflects a: E = π·L ÷ (1 − a).
TEST(ShInterpolation, FurnaceReachesTheClosedForm) {
  const PlannedLevel level(test::furnace(0.5f, 1), 1);
  for (const int order : {0, 2, 5}) {
    for (const Vec3 e : level.light(*sh(level, order), 20)) ASSERT_NEAR(e.x, 2 * kPi, 5e-3f * kPi) << "order " << order;
  }
}

// The sky's half of the sphere: E of an upward normal is π by bands 0 and 1 alone, A_0·Y_0² · 2π + A_1·Y_1² · π. Band 0
// gives half.
TEST(ShInterpolation, SkyOverAPlaneIsExactByOrderOne) {
  Scene scene = test::open_plane(60, {1, 1, 1});
  scene.materials[0].base_color = {};
  const PlannedLevel level(std::move(scene), 2, 0.5f);
  const auto middle = [&](int order) {
    const std::vector<Vec3> e = level.light(*sh(level, order), 1);
    double sum = 0;
    int count = 0;
    for (size_t r = 0; r < e.size(); ++r) {
      const Vec3 p = level.plan.receivers.all[r].point.position;
      if (std::abs(p.x) > 4 || std::abs(p.z) > 4) continue;
      sum += static_cast<double>(e[r].x);
      ++count;
    }
    return sum / count;
  };
  EXPECT_NEAR(middle(0), kPi / 2, 0.05 * kPi);
  EXPECT_NEAR(middle(1), kPi, 0.02 * kPi);
  EXPECT_NEAR(middle(2), kPi, 0.02 * kPi);
}

// One probe: receivers read its irradiance along their normals.
TEST(ShInterpolation, OneProbeGivesTheIrradianceAtItsPlace) {
  const PlannedLevel level(test::east_lit_cube(), 4);
  ASSERT_EQ(level.plan.placement.probes.size(), 1u);
  const Vec3 probe = level.plan.placement.probes[0].position;
  const std::vector<Vec3> e = level.light(*sh(level, 2), 1);
  for (size_t r = 0; r < e.size(); ++r) {
    const Vec3 n = level.plan.receivers.all[r].point.normal;
    ASSERT_NEAR(e[r].x, test::irradiance_in_east_lit_cube(probe, n), 0.02f * kPi) << n.x << " " << n.y << " " << n.z;
  }
}

TEST(ShInterpolation, AnyNumberOfThreadsGivesTheSameLight) {
  const PlannedLevel level(test::sealed_double_room(0.05f), 1);
  const auto baseline = sh(level, 2);
  EXPECT_EQ(level.light(*baseline, 2, 1), level.light(*baseline, 2, 4));
}

TEST(ShInterpolation, ErrorsAreNamed) {
  PlannedLevel level(test::furnace(0.5f, 1), 1);
  EXPECT_THAT(std::string(make_sh_interpolation(*level.tracer, level.plan, 10, {}).status().message()),
              ::testing::HasSubstr("order"));
  level.plan.params.method = BakeMethod::kSl17;
  EXPECT_THAT(std::string(make_sh_interpolation(*level.tracer, level.plan, 2, {}).status().message()),
              ::testing::HasSubstr("method"));
}

}  // namespace
}  // namespace lightloom
