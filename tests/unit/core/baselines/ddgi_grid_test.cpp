#include "core/baselines/ddgi_grid.h"

#include <gtest/gtest.h>

#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using test::value_or_die;

Aabb box_of(Vec3 lo, Vec3 hi) { return {lo, hi}; }

TEST(DdgiGrid, LiesWithinTheBoxOrAroundIt) {
  const Aabb box = box_of({0, 0, 0}, {4, 2, 0.2f});
  const DdgiGrid inside = value_or_die(make_ddgi_grid(box, 1, false));
  EXPECT_EQ(inside.counts, (std::array<uint32_t, 3>{4, 2, 2}));  // thin axis: enclosed
  EXPECT_EQ(inside.rest(0), (Vec3{0.5f, 0.5f, -0.4f}));
  EXPECT_EQ(inside.rest(inside.size() - 1), (Vec3{3.5f, 1.5f, 0.6f}));
  const DdgiGrid around = value_or_die(make_ddgi_grid(box, 1, true));
  EXPECT_EQ(around.counts, (std::array<uint32_t, 3>{6, 4, 2}));
  EXPECT_EQ(around.rest(0), (Vec3{-0.5f, -0.5f, -0.4f}));
}

TEST(DdgiGrid, CagesHoldTheirPoints) {
  const DdgiGrid grid = value_or_die(make_ddgi_grid(box_of({0, 0, 0}, {4, 3, 1}), 1, false));
  ASSERT_EQ(grid.counts, (std::array<uint32_t, 3>{4, 3, 1}));
  const Vec3 p{1.75f, 1.0f, 0.9f};
  const DdgiGrid::Cage cage = grid.cage(p);
  Vec3 blend;
  for (uint32_t c = 0; c < 8; ++c) {
    float weight = 1;
    for (int a = 0; a < 3; ++a) weight *= c >> a & 1 ? cage.alpha[a] : 1 - cage.alpha[a];
    blend += grid.rest(cage.base + grid.corners()[c]) * weight;
  }
  EXPECT_LT(length(blend - Vec3{1.75f, 1.0f, 0.5f}), 1e-5f);  // one probe wide along z
  EXPECT_EQ(grid.cage({9, 9, 9}).base + grid.corners()[7], grid.size() - 1);
  EXPECT_EQ(grid.cage({-9, -9, -9}).base, 0u);
}

TEST(DdgiGrid, TooManyProbesAreRefused) {
  const auto grid = make_ddgi_grid(box_of({0, 0, 0}, {1000, 1000, 1000}), 1e-6f, false);
  ASSERT_FALSE(grid.ok());
  EXPECT_EQ(grid.status().code(), absl::StatusCode::kInvalidArgument);
}

class DdgiPlacement : public ::testing::Test {
 protected:
  Scene scene_ = test::room_with_crate();  // the crate: x, z in [1, 2.5], y in [0, 1]
  std::unique_ptr<RayTracer> tracer_ = value_or_die(RayTracer::create(scene_));
};

TEST_F(DdgiPlacement, OutOfASolidThroughTheNearestBackFace) {
  const DdgiProbe moved = place_ddgi_probe(*tracer_, {1.75f, 0.8f, 1.75f}, {1, 1, 1}, 0.2f);
  EXPECT_TRUE(moved.open);
  EXPECT_GT(moved.position.y, 1.05f);
  EXPECT_LE(length(moved.position - Vec3{1.75f, 0.8f, 1.75f}), 0.45f);
  EXPECT_FALSE(place_ddgi_probe(*tracer_, {1.75f, 0.8f, 1.75f}, {1, 1, 1}, 0).open);
}

TEST_F(DdgiPlacement, TooDeepIsOff) {
  EXPECT_FALSE(place_ddgi_probe(*tracer_, {1.75f, 0.45f, 1.75f}, {1, 1, 1}, 0.2f).open);
}

TEST_F(DdgiPlacement, BacksOffFromASurface) {
  const DdgiProbe moved = place_ddgi_probe(*tracer_, {2, 2.95f, 2}, {1, 1, 1}, 0.2f);
  EXPECT_TRUE(moved.open);
  EXPECT_LT(moved.position.y, 2.9f);
  EXPECT_EQ(place_ddgi_probe(*tracer_, {2, 2, 2}, {1, 1, 1}, 0.2f).position, (Vec3{2, 2, 2}));
}

}  // namespace
}  // namespace lightloom
