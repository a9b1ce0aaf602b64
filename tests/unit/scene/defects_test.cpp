#include "core/scene/defects.h"

#include <gtest/gtest.h>

#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

/// A 3 m × 3 m grid of quads of 1 m in the plane y = 0.
Scene floor_of(const std::vector<std::array<Vec3, 4>>& quads) {
  Scene scene;
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  for (const auto& q : quads) test::add_wall_object(&scene, "quad", q[0], q[1], q[2], q[3], grey);
  test::identify(&scene);
  return scene;
}

std::array<Vec3, 4> tile(float x0, float x1, float z0, float z1) {
  return {Vec3{x0, 0, z1}, Vec3{x1, 0, z1}, Vec3{x1, 0, z0}, Vec3{x0, 0, z0}};
}

TEST(Defects, WellMadeLevelsHaveNone) {
  EXPECT_EQ(find_defects(floor_of({tile(0, 1, 0, 1), tile(1, 2, 0, 1), tile(2, 3, 0, 1)})), Defects{});
  EXPECT_EQ(find_defects(test::closed_box({2, 3, 4})), Defects{});
  EXPECT_EQ(find_defects(test::room_with_crate()), Defects{});
  EXPECT_EQ(describe({}), "");
}

TEST(Defects, Duplicates) {
  const Defects d = find_defects(floor_of({tile(0, 1, 0, 1), tile(0, 1, 0, 1), tile(0, 1, 0, 1)}));
  EXPECT_EQ(d.duplicates, 4u);
  EXPECT_EQ(d.t_junctions + d.cracks + d.flipped, 0u);
}

TEST(Defects, Flipped) {
  auto turned = tile(1, 2, 0, 1);
  std::swap(turned[1], turned[3]);
  const Defects d = find_defects(floor_of({tile(0, 1, 0, 1), turned}));
  EXPECT_EQ(d.flipped, 1u);
  EXPECT_EQ(d.duplicates + d.t_junctions + d.cracks, 0u);
}

TEST(Defects, TJunctions) {
  // One long tile beside two short ones.
  const Defects d = find_defects(floor_of({tile(0, 2, 0, 1), tile(0, 1, 1, 2), tile(1, 2, 1, 2)}));
  EXPECT_EQ(d.t_junctions, 1u);
  EXPECT_EQ(d.duplicates + d.cracks + d.flipped, 0u);
}

TEST(Defects, Cracks) {
  // A centimetre apart: the long edges along the gap, but not those that merely end at it.
  const Defects d = find_defects(floor_of({tile(0, 1, 0, 1), tile(1.01f, 2, 0, 1)}));
  EXPECT_EQ(d.cracks, 2u);
  EXPECT_EQ(d.duplicates + d.t_junctions + d.flipped, 0u);
  // Ten centimetres are a gap that somebody meant.
  EXPECT_EQ(find_defects(floor_of({tile(0, 1, 0, 1), tile(1.1f, 2, 0, 1)})), Defects{});
}

TEST(Defects, DescribesInWords) {
  EXPECT_EQ(describe({1, 0, 0, 0}), "1 duplicate triangle");
  EXPECT_EQ(describe({2, 1, 3, 0}),
            "2 duplicate triangles, 1 edge between triangles that face opposite ways, 3 T-junctions");
  EXPECT_EQ(describe({0, 0, 0, 5}), "5 edges along cracks");
}

TEST(Defects, SharedDefectsSceneHasAllKinds) {
  const auto path = test::scenes_folder() / "defects" / "scene.glb";
  if (!std::filesystem::exists(path)) GTEST_SKIP() << "needs " << path;
  const auto scene = load_gltf(path);
  ASSERT_TRUE(scene.ok()) << scene.status();
  const Defects d = find_defects(*scene);
  EXPECT_GE(d.duplicates, 2u);
  EXPECT_GE(d.t_junctions, 1u);
  EXPECT_GE(d.cracks, 1u);
}

}  // namespace
}  // namespace lightloom
