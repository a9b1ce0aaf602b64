#include "core/probes/sl17_placement.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "core/probes/links.h"
#include "core/probes/voxels.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using test::value_or_die;
using ::testing::HasSubstr;

struct Level {
  explicit Level(Scene s, float texels_per_metre = 4) : scene(std::move(s)) {
    tracer = value_or_die(RayTracer::create(scene));
    LayoutOptions options;
    options.texels_per_metre = texels_per_metre;
    layout = value_or_die(make_layout(scene, options));
    receivers = value_or_die(find_receivers(*tracer, layout, {}));
  }
  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  AtlasLayout layout;
  Receivers receivers;
};

TEST(Sl17Placement, AsManyAsARegularGrid) {
  Level level(test::closed_box({3, 2, 4}));
  const auto placed = value_or_die(place_probes_sl17(*level.tracer, &level.receivers, {0.9f, 0, 10}, {}));
  EXPECT_EQ(placed.probes.size(), 4u * 3 * 5);
  EXPECT_EQ(placed.repairs, 0u);
  EXPECT_TRUE(std::is_sorted(placed.probes.begin(), placed.probes.end(),
                             [](const Probe& a, const Probe& b) { return a.name() < b.name(); }));
  for (size_t i = 1; i < placed.probes.size(); ++i) EXPECT_NE(placed.probes[i - 1].name(), placed.probes[i].name());
}

TEST(Sl17Placement, ProbesStandInTheRoomAndNotInTheCrate) {
  Level level(test::room_with_crate());
  const auto placed = value_or_die(place_probes_sl17(*level.tracer, &level.receivers, {0.8f, 60, 10}, {}));
  ASSERT_EQ(placed.probes.size(), 60u);
  for (const Probe& p : placed.probes) {
    const Vec3 q = p.position;
    EXPECT_TRUE(q.x > 0 && q.x < 4 && q.y > 0 && q.y < 3 && q.z > 0 && q.z < 4);
    EXPECT_FALSE(q.x > 1 && q.x < 2.5f && q.y < 1 && q.z > 1 && q.z < 2.5f);
  }
  // No two crowd: thinning leaves gaps of about the spacing.
  for (size_t i = 0; i < placed.probes.size(); ++i) {
    for (size_t j = 0; j < i; ++j) EXPECT_GT(length(placed.probes[i].position - placed.probes[j].position), 0.35f);
  }
}

TEST(Sl17Placement, NoProbesAroundTheOuterWalls) {
  // A house with a doorway, which the flood leaves by.
  Scene scene;
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  const auto box = [&](Vec3 lo, Vec3 hi) { test::add_solid_box(&scene, "part", lo, hi, grey); };
  box({0, -0.2f, 0}, {4, 0, 4});
  box({0, 3, 0}, {4, 3.2f, 4});
  box({0, 0, 0}, {0.2f, 3, 4});
  box({3.8f, 0, 0}, {4, 3, 4});
  box({0.2f, 0, 0}, {3.8f, 3, 0.2f});
  box({0.2f, 0, 3.8f}, {1, 3, 4});
  box({2, 0, 3.8f}, {3.8f, 3, 4});
  test::identify(&scene);
  Level level(std::move(scene), 2);
  const auto placed = value_or_die(place_probes_sl17(*level.tracer, &level.receivers, {1, 40, 10}, {}));
  ASSERT_EQ(placed.probes.size(), 40u);
  for (const Probe& p : placed.probes) {
    EXPECT_TRUE(p.position.x > 0 && p.position.x < 4 && p.position.y > -0.2f && p.position.y < 3.2f);
    EXPECT_TRUE(p.position.z > 0 && p.position.z < 4);
  }
}

TEST(Sl17Placement, AnOpenPlaneHasProbesToo) {
  Level level(test::open_plane(3, {1, 1, 1}));
  const auto placed = value_or_die(place_probes_sl17(*level.tracer, &level.receivers, {1, 8, 10}, {}));
  EXPECT_EQ(placed.probes.size(), 8u);
}

TEST(Sl17Placement, RadiusCoversReceiversByTheOverlapOnAverage) {
  Level level(test::closed_box({3, 2, 4}));
  for (const int overlap : {3, 10, 25}) {
    const auto placed = value_or_die(place_probes_sl17(*level.tracer, &level.receivers, {0.9f, 0, overlap}, {}));
    const ProbeGrid grid(placed.probes, 0.9f);
    double links = 0;
    for (const Receiver& r : level.receivers.all) {
      links += static_cast<double>(grid.within(r.point.position, placed.radius).size());
    }
    EXPECT_NEAR(links / static_cast<double>(level.receivers.all.size()), overlap, 0.02 * overlap);
  }
  const auto few = value_or_die(place_probes_sl17(*level.tracer, &level.receivers, {0.9f, 5, 10}, {}));
  const ProbeGrid grid(few.probes, 0.9f);
  for (const Receiver& r : level.receivers.all) EXPECT_EQ(grid.within(r.point.position, few.radius).size(), 5u);
  EXPECT_LT(few.radius, length(level.scene.bounds().size()));
}

TEST(Sl17Placement, TooFineASpacingIsAnError) {
  Level level(test::closed_box({3, 2, 4}));
  const auto placed = place_probes_sl17(*level.tracer, &level.receivers, {0.01f, 0, 10}, {});
  ASSERT_EQ(placed.status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_THAT(std::string(placed.status().message()), HasSubstr("--spacing of at least"));
  // What the message proposes works.
  const std::string text(placed.status().message());
  const float least = std::stof(text.substr(text.rfind(' ')));
  EXPECT_LE(Voxels::count_for(level.scene.bounds(), least / 8), Voxels::kMost);
}

}  // namespace
}  // namespace lightloom
