#include "cli/scene_edit.h"

#include <gtest/gtest.h>

#include "core/bake/plan.h"
#include "core/scene/builtin.h"
#include "core/scene/mesh_hash.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

const Material& material_of(const Scene& scene, const std::string& object) {
  return scene.materials[scene.objects[test::object_named(scene, object)].triangles[0].material];
}

TEST(SceneEdit, ColoursOneObjectAlone) {
  Scene scene = *builtin_scene("flat");
  const Vec3 bed = material_of(scene, "bed").base_color;
  ASSERT_TRUE(set_albedo("sofa:0.9,0.1,0;wall east:0.2,0.3,0.4", &scene).ok());
  ASSERT_TRUE(set_emission("sofa:1,2,3", &scene).ok());
  EXPECT_EQ(material_of(scene, "sofa").base_color, (Vec3{0.9f, 0.1f, 0}));
  EXPECT_EQ(material_of(scene, "sofa").emission, (Vec3{1, 2, 3}));
  EXPECT_EQ(material_of(scene, "wall east").base_color, (Vec3{0.2f, 0.3f, 0.4f}));
  EXPECT_EQ(material_of(scene, "bed").base_color, bed);
  EXPECT_EQ(material_of(scene, "bed").emission, (Vec3{}));
}

TEST(SceneEdit, ColoursAreInNoHash) {
  Scene scene = *builtin_scene("flat");
  const Digest before = scene_hash(scene);
  ASSERT_TRUE(set_albedo("sofa:0.9,0.1,0", &scene).ok());
  ASSERT_TRUE(set_emission("sofa:1,2,3", &scene).ok());
  MeshHasher hasher(scene);
  for (Object& object : scene.objects) EXPECT_EQ(hasher.hash(object), object.mesh_hash) << object.name;
  assign_object_ids(&scene);
  EXPECT_EQ(scene_hash(scene), before);
}

TEST(SceneEdit, AMaskKeepsItsTexture) {
  Scene scene = test::open_plane(1, {});
  scene.textures.resize(1);
  scene.materials[0].base_color_texture = 0;
  scene.materials[0].alpha_mode = AlphaMode::kMask;
  ASSERT_TRUE(set_albedo("plane:0.5,0.5,0.5", &scene).ok());
  EXPECT_EQ(material_of(scene, "plane").base_color_texture, 0);
  scene.materials[0].alpha_mode = AlphaMode::kOpaque;
  scene.objects[0].triangles[0].material = 0;
  ASSERT_TRUE(set_albedo("plane:0.5,0.5,0.5", &scene).ok());
  EXPECT_EQ(material_of(scene, "plane").base_color_texture, -1);
}

TEST(SceneEdit, ErrorsNameWhatIsWrong) {
  Scene scene = *builtin_scene("cornell");
  EXPECT_EQ(set_albedo("nobody:1,1,1", &scene).code(), absl::StatusCode::kNotFound);
  for (const char* bad : {"floor", "floor:", "floor:1,2", "floor:1,2,3,4", "floor:1;2;3", "floor:-1,0,0",
                          "floor:nan,0,0", "floor:1.5,0,0", "floor:1,2,x", "floor:1,2,3 4"}) {
    EXPECT_EQ(set_albedo(bad, &scene).code(), absl::StatusCode::kInvalidArgument) << bad;
  }
  EXPECT_TRUE(set_albedo("", &scene).ok());
}

TEST(LightPath, GoesAlongItsLinesAtConstantSpeed) {
  Scene scene = *builtin_scene("flat");
  const auto path = LightPath::parse("kitchen", "0,0,0;3,0,0;3,0,1", scene);
  ASSERT_TRUE(path.ok()) << path.status();
  const auto at = [&](float t) {
    path->move(t, &scene);
    return scene.lights[1].position;
  };
  ASSERT_EQ(scene.lights[1].name, "kitchen");
  const Vec3 other = scene.lights[0].position;
  EXPECT_EQ(at(0), (Vec3{0, 0, 0}));
  EXPECT_EQ(at(0.5f), (Vec3{2, 0, 0}));
  EXPECT_EQ(at(0.75f), (Vec3{3, 0, 0}));
  EXPECT_EQ(at(1), (Vec3{3, 0, 1}));
  EXPECT_EQ(scene.lights[0].position, other);
}

TEST(LightPath, ErrorsNameWhatIsWrong) {
  Scene flat = *builtin_scene("flat"), town = *builtin_scene("town");
  EXPECT_EQ(LightPath::parse("nobody", "0,0,0;1,1,1", flat).status().code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(LightPath::parse("", "0,0,0;1,1,1", flat).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(LightPath::parse("kitchen", "0,0,0", flat).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(LightPath::parse("kitchen", "0,0;1,1", flat).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_EQ(LightPath::parse("", "0,0,0;1,1,1", town).status().code(), absl::StatusCode::kInvalidArgument);
  EXPECT_TRUE(LightPath::parse("", "0,0,0;1,1,1", *builtin_scene("cornell")).ok());
}

}  // namespace
}  // namespace lightloom
