#include "core/baselines/ddgi.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/core/baselines/planned_level.h"

namespace lightloom {
namespace {

using test::PlannedLevel;
using test::value_or_die;

std::unique_ptr<Baseline> ddgi(const PlannedLevel& level, const DdgiParams& params) {
  return value_or_die(make_ddgi(*level.tracer, level.plan, params, {}));
}

// Every wall emits L and reflects a: E = π·L ÷ (1 − a), whatever the weights are.
TEST(Ddgi, FurnaceReachesTheClosedForm) {
  const PlannedLevel level(test::furnace(0.5f, 1), 1);
  for (const bool perceptual : {false, true}) {
    DdgiParams params;
    params.perceptual = perceptual;
    for (const Vec3 e : level.light(*ddgi(level, params), 20)) {
      ASSERT_NEAR(e.x, 2 * kPi, 2e-3f * kPi) << (perceptual ? "perceptual" : "linear");
    }
  }
}

// A frame is a bounce: E_n = π·L·(1 + a + … + a^(n−1)).
TEST(Ddgi, EachFrameAddsABounce) {
  const PlannedLevel level(test::furnace(0.5f, 1), 1);
  const auto baseline = ddgi(level, {});
  for (const Vec3 e : level.light(*baseline, 0)) ASSERT_EQ(e, Vec3{});
  for (const Vec3 e : level.light(*baseline, 1)) ASSERT_NEAR(e.x, kPi, 1e-3f * kPi);
  for (const Vec3 e : level.light(*baseline, 3)) ASSERT_NEAR(e.x, 1.75f * kPi, 1e-3f * kPi);
}

// One probe in the middle: receivers read its irradiance along their normals.
TEST(Ddgi, OneProbeGivesTheIrradianceAtItsPlace) {
  const PlannedLevel level(test::east_lit_cube(), 2);
  DdgiParams params;
  params.spacing = 2;
  params.perceptual = false;
  const auto baseline = ddgi(level, params);
  ASSERT_EQ(baseline->probes(), 1u);
  const std::vector<Vec3> e = level.light(*baseline, 1);
  for (size_t r = 0; r < e.size(); ++r) {
    const Vec3 n = level.plan.receivers.all[r].point.normal;
    // Bilinear texels of 30 degrees blur.
    ASSERT_NEAR(e[r].x, test::irradiance_in_east_lit_cube({1, 1, 1}, n), 0.03f * kPi)
        << n.x << " " << n.y << " " << n.z;
  }
}

// The crate, solid and double-sided, holds probes of the grid. One of them that shone would see no light in there.
TEST(Ddgi, ProbesInSolidsGiveNoLight) {
  Scene scene = test::room_with_crate();
  for (Material& m : scene.materials) m.emission = {1, 1, 1};
  const PlannedLevel level(std::move(scene), 1);
  DdgiParams params;
  params.spacing = 0.6f;
  params.distance_rays = 1024;
  params.clearance = 0;
  const auto stay = ddgi(level, params);
  params.clearance = 0.2f;
  const auto moved = ddgi(level, params);
  EXPECT_GT(moved->probes(), stay->probes());
  for (const auto& baseline : {stay.get(), moved.get()}) {
    const std::vector<Vec3> e = level.light(*baseline, 12);
    for (size_t r = 0; r < e.size(); ++r) {
      const Receiver& at = level.plan.receivers.all[r];
      if (at.point.position.y < 0) continue;  // under the floor there is no light
      ASSERT_NEAR(e[r].x, 2 * kPi, 4e-3f * kPi) << level.scene.objects[at.object].name << " " << at.key;
    }
  }
}

TEST(Ddgi, KeptWeightsGiveTheSameLight) {
  const PlannedLevel level(test::sealed_double_room(0.05f), 1);
  DdgiParams params;
  const auto anew = ddgi(level, params);
  params.keep_weights = true;
  const auto kept = ddgi(level, params);
  EXPECT_EQ(level.light(*anew, 2), level.light(*kept, 2));
}

TEST(Ddgi, AnyNumberOfThreadsGivesTheSameLight) {
  const PlannedLevel level(test::sealed_double_room(0.05f), 1);
  BakeControl one, four;
  one.threads = 1;
  four.threads = 4;
  const auto a = value_or_die(make_ddgi(*level.tracer, level.plan, {}, one));
  const auto b = value_or_die(make_ddgi(*level.tracer, level.plan, {}, four));
  EXPECT_EQ(level.light(*a, 2, 1), level.light(*b, 2, 4));
}

// 64 texels of 4 bytes, 256 of 4, offset and state 8, and 1024 rays of 4: per probe.
TEST(Ddgi, BytesAreThoseOfThePapersFormats) {
  const PlannedLevel level(test::furnace(0.5f, 1), 1);
  DdgiParams params;
  const auto baseline = ddgi(level, params);
  ASSERT_EQ(baseline->probes(), 8u);
  EXPECT_EQ(baseline->bytes(), 8u * (256 + 1024 + 8 + 4 * 1024));
  EXPECT_EQ(baseline->bytes_per_frame(), 8u * (2 * 256 + 1024 + 8 + 4 * 1024));
  params.keep_weights = true;
  EXPECT_EQ(ddgi(level, params)->bytes(), 8u * (256 + 8 + 4 * 1024) + level.plan.receivers.all.size() * 20);
}

TEST(Ddgi, ParametersOutOfRangeAreNamed) {
  const PlannedLevel level(test::furnace(0.5f, 1), 1);
  const auto error = [&](auto&& change) {
    DdgiParams params;
    change(&params);
    return std::string(make_ddgi(*level.tracer, level.plan, params, {}).status().message());
  };
  EXPECT_THAT(error([](DdgiParams* p) { p->spacing = 0; }), ::testing::HasSubstr("spacing"));
  EXPECT_THAT(error([](DdgiParams* p) { p->spacing = NAN; }), ::testing::HasSubstr("spacing"));
  EXPECT_THAT(error([](DdgiParams* p) { p->spacing = 1e-4f; }), ::testing::HasSubstr("probes"));
  EXPECT_THAT(error([](DdgiParams* p) { p->bias = -1; }), ::testing::HasSubstr("bias"));
  EXPECT_THAT(error([](DdgiParams* p) { p->clearance = 1; }), ::testing::HasSubstr("clearance"));
  EXPECT_THAT(error([](DdgiParams* p) { p->distance_rays = 0; }), ::testing::HasSubstr("distance rays"));
}

}  // namespace
}  // namespace lightloom
