// What an edit may have reached, and what it cannot.
#include "core/trace/changes.h"

#include <gtest/gtest.h>

#include "core/trace/trace_recorder.h"
#include "tests/support/test_scenes.h"
#include "tests/unit/core/trace/small_world.h"

namespace lightloom {
namespace {

using test::SmallWorld;

Trace ray(const WorldGrid& grid, Vec3 from, Vec3 to) {
  TraceRecorder recorder(grid, 0);
  recorder.from({from, from});
  recorder.hit(to, 0);
  return recorder.finish({});
}

Trace ray_to_sky(const WorldGrid& grid, Vec3 from, Vec3 direction) {
  TraceRecorder recorder(grid, 0);
  recorder.from({from, from});
  recorder.sky(direction);
  return recorder.finish({});
}

Scene with_crate_at(float x) {
  Scene scene = test::room_with_crate();
  for (Vec3& p : scene.objects[test::object_named(scene, "crate")].positions) p.x += x;
  test::identify(&scene);
  return scene;
}

TEST(Changes, NothingIsChangedByNothing) {
  const SmallWorld world(test::room_with_crate());
  const Changes changes(world.contents, world.contents);
  EXPECT_EQ(changes.cells(), 0u);
  EXPECT_EQ(changes.share(ray(world.contents.grid, {0.2f, 0.2f, 0.2f}, {3.8f, 2.8f, 3.8f})), 0);
}

TEST(Changes, RaysAreReachedByWhatTheyPassOnly) {
  const SmallWorld before(with_crate_at(0)), after(with_crate_at(0.3f));
  const Changes changes(before.contents, after.contents);
  EXPECT_GT(changes.cells(), 10u);
  const auto share = [&](Vec3 from, Vec3 to) { return changes.share(ray(before.contents.grid, from, to)); };
  EXPECT_EQ(share({0.2f, 0.5f, 1.7f}, {3.9f, 0.5f, 1.7f}), 1);  // through it
  EXPECT_EQ(share({0.2f, 2.5f, 0.2f}, {3.9f, 2.5f, 3.9f}), 0);  // high above it
  EXPECT_EQ(share({0.2f, 0.5f, 3.9f}, {3.9f, 0.5f, 3.9f}), 0);  // past it
}

TEST(Changes, ReceiversCountToo) {
  // The same geometry, another side: a wall that has no receivers any more.
  Scene scene = test::room_with_crate();
  const SmallWorld before(scene);
  WorldContents after = before.contents;
  for (CellContents& c : after.contents) c.receivers = {};
  const Changes changes(before.contents, after);
  const Trace trace = ray(before.contents.grid, {2, 1.5f, 3}, {2, 0.1f, 3});
  EXPECT_EQ(changes.share(trace), 1);
}

TEST(Changes, WhatIsAddedBesideTheLevelIsSeenThroughTheSky) {
  Scene scene = test::open_plane(4, {1, 1, 1});
  const SmallWorld before(scene);
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  // (Without a lightmap: another one would change the layout of all.)
  test::add_solid_box(&scene, "tower", {10, 0, 0}, {12, 20, 2}, grey).receive = Receive::kNone;
  test::identify(&scene);
  const SmallWorld after(scene);
  const Changes changes(before.contents, after.contents);
  EXPECT_EQ(changes.share(ray_to_sky(before.contents.grid, {0, 0.1f, 0}, {0, 1, 0})), 1);
  EXPECT_EQ(changes.share(ray(before.contents.grid, {0, 0.1f, 0}, {1, 0, 1})), 0);
}

TEST(Changes, OtherCellsOfTheWorldCannotBeCompared) {
  const SmallWorld world(test::room_with_crate());
  WorldContents other = world.contents;
  ++other.grid.level;
  EXPECT_EQ(Changes(world.contents, other).share(ray(world.contents.grid, {0.2f, 0.2f, 0.2f}, {0.3f, 0.3f, 0.3f})), 1);
}

}  // namespace
}  // namespace lightloom
