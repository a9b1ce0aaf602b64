// The big test scenes, where they are at hand: a folder named by LIGHTLOOM_SCENES.
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>

#include "core/scene/gltf.h"
#include "core/scene/rig.h"

namespace lightloom {
namespace {

std::filesystem::path scenes_folder() {
  if (const char* folder = std::getenv("LIGHTLOOM_SCENES")) return folder;
#ifdef LIGHTLOOM_SOURCE_DIR
  return std::filesystem::path(LIGHTLOOM_SOURCE_DIR).parent_path() / "shared" / "scenes";
#else
  return {};
#endif
}

struct Expected {
  const char* name;
  uint64_t triangles, without_area;
  size_t objects;
};

class SharedScenes : public testing::TestWithParam<Expected> {};

TEST_P(SharedScenes, LoadWithTheirTrianglesAndRigs) {
  const std::filesystem::path folder = scenes_folder() / GetParam().name;
  if (!std::filesystem::exists(folder / "scene.glb")) {
    GTEST_SKIP() << "no " << GetParam().name << "/scene.glb: set LIGHTLOOM_SCENES to the folder of the test scenes";
  }
  const auto scene = load_gltf(folder / "scene.glb");
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->triangle_count(), GetParam().triangles - GetParam().without_area);
  EXPECT_EQ(scene->objects.size(), GetParam().objects);
  EXPECT_EQ(scene->warnings.size(), GetParam().without_area > 0 ? 1u : 0u);
  EXPECT_FALSE(scene->lights.empty());
  EXPECT_FALSE(scene->cameras.empty());
  for (const Object& o : scene->objects) EXPECT_EQ(o.uv1.size(), o.positions.size());

  const auto rigs = load_rigs(folder / "lights.json");
  ASSERT_TRUE(rigs.ok()) << rigs.status();
  EXPECT_FALSE(rigs->empty());
  Scene relit = *scene;
  for (const Rig& rig : *rigs) EXPECT_TRUE(apply_rig(rig, &relit).ok()) << rig.name;
}

INSTANTIATE_TEST_SUITE_P(All, SharedScenes,
                         testing::Values(Expected{"cornell", 30, 0, 3}, Expected{"rooms", 480, 0, 7},
                                         Expected{"maze", 1952, 0, 5}, Expected{"city", 1386, 0, 5},
                                         Expected{"defects", 88, 7, 3}, Expected{"sponza", 262267, 1, 25}),
                         [](const auto& info) { return info.param.name; });

}  // namespace
}  // namespace lightloom
