// How much light comes through a wall, by method. That of DDGI depends on where its grid lies to the wall: with probes
// much nearer than these, and evenly on both sides, it may fall below that of lightloom's compression.
#include <gtest/gtest.h>

#include "core/baselines/ddgi.h"
#include "core/baselines/sh_interpolation.h"
#include "tests/unit/core/baselines/planned_level.h"

namespace lightloom {
namespace {

using test::PlannedLevel;
using test::value_or_die;

/// Mean E in the dark room ÷ that in the lit one, area-weighted.
double leak(const PlannedLevel& level, const std::vector<Vec3>& e) {
  double sum[2] = {}, area[2] = {};
  for (size_t i = 0; i < e.size(); ++i) {
    const Receiver& r = level.plan.receivers.all[i];
    const int dark = r.point.position.x > 3;
    const auto texel = static_cast<double>(level.plan.receivers.grids[r.object].texels[r.texel].area);
    sum[dark] += texel * static_cast<double>(e[i].x + e[i].y + e[i].z);
    area[dark] += texel;
  }
  return sum[1] / area[1] / (sum[0] / area[0]);
}

TEST(Leaks, ThroughAWallOfFiveCentimetres) {
  constexpr int kBounces = 8;
  double all_weighted = 0, all_ours = 0;
  for (const float spacing : {1.0f, 1.3f, 2.0f}) {
    const PlannedLevel level(test::sealed_double_room(0.05f), spacing, 6, 4096);
    const auto sh = value_or_die(make_sh_interpolation(*level.tracer, level.plan, 2, {}));
    DdgiParams params;
    params.spacing = spacing;
    const auto ddgi = value_or_die(make_ddgi(*level.tracer, level.plan, params, {}));
    const double plain = leak(level, level.light(*sh, kBounces)), weighted = leak(level, level.light(*ddgi, kBounces));

    const auto baked = test::bake_level(test::sealed_double_room(0.05f), level.plan.params);
    ASSERT_EQ(baked->elements.receivers.all.size(), level.plan.receivers.all.size());
    const double ours = leak(level, test::light(*baked, kBounces));
    std::printf("leak at %.1f m: plain SH %.4f (%d probes), DDGI %.6f (%d probes), lightloom %.2e\n",
                static_cast<double>(spacing), plain, static_cast<int>(sh->probes()), weighted,
                static_cast<int>(ddgi->probes()), ours);
    EXPECT_LT(weighted, plain / 3);
    EXPECT_GT(weighted, ours);
    EXPECT_LT(ours, 1e-4);
    all_weighted += weighted;
    all_ours += ours;
  }
  EXPECT_GT(all_weighted, 5 * all_ours);
}

}  // namespace
}  // namespace lightloom
