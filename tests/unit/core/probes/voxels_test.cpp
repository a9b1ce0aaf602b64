#include "core/probes/voxels.h"

#include <gtest/gtest.h>

#include "core/base/rng.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

TEST(Voxels, NoPointOfASurfaceIsInAnEmptyVoxel) {
  Scene scene;
  Rng rng(3);
  const auto point = [&] {
    const float x = 5 * rng.next_float(), y = 5 * rng.next_float();
    return Vec3{x, y, 5 * rng.next_float()};
  };
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  for (int i = 0; i < 12; ++i) {
    const Vec3 a = point(), b = point(), c = point();
    test::add_wall_object(&scene, "wall", a, b, c, a + c - b, grey);
  }
  test::identify(&scene);
  const Voxels voxels(scene, 0.31f);
  int checked = 0;
  for (const Object& o : scene.objects) {
    for (const Triangle& t : o.triangles) {
      for (int i = 0; i < 300; ++i, ++checked) {
        float b1 = rng.next_float(), b2 = rng.next_float();
        if (b1 + b2 > 1) b1 = 1 - b1, b2 = 1 - b2;
        EXPECT_FALSE(voxels.empty(interpolate(o.positions, t, b1, b2)));
      }
    }
  }
  EXPECT_EQ(checked, 12 * 2 * 300);
}

TEST(Voxels, FloodStaysInItsRoom) {
  // Two rooms apart by a wall thinner than a voxel.
  const Scene scene = test::sealed_double_room(0.02f);
  Voxels voxels(scene, 0.2f);
  voxels.flood({1.5f, 1.5f, 1.5f});
  const auto found = voxels.connected_near_surfaces();
  ASSERT_GT(found.size(), 500u);
  for (const Vec3 p : found) {
    EXPECT_LT(p.x, 3.0f);
    EXPECT_GT(p.x, 0.0f);
    EXPECT_TRUE(voxels.empty(p));
    // A voxel next to one that a wall crosses.
    const float gap = std::min({p.x, 2.99f - p.x, p.y, 3 - p.y, p.z, 3 - p.z});
    EXPECT_LT(gap, 2.1f * 0.2f);
  }
}

TEST(Voxels, FloodFromAWallOrFromOutsideDoesNothing) {
  const Scene scene = test::closed_box({2, 2, 2});
  Voxels voxels(scene, 0.1f);
  voxels.flood({0, 1, 1});
  voxels.flood({50, 1, 1});
  voxels.flood({-50, 1, 1});
  EXPECT_TRUE(voxels.connected_near_surfaces().empty());
}

TEST(Voxels, CountsBeforeItAllocates) {
  Aabb box;
  box.extend({0, 0, 0});
  box.extend({10, 1, 0});
  EXPECT_EQ(Voxels::count_for(box, 1), 13.0 * 4 * 3);
  EXPECT_GT(Voxels::count_for(box, 1e-4f), Voxels::kMost);
}

}  // namespace
}  // namespace lightloom
