#include "core/scene/rig.h"

#include <gmock/gmock.h>

#include "tests/unit/scene/gltf_fixture.h"

namespace lightloom {
namespace {

using testing::HasSubstr;

absl::StatusOr<std::vector<Rig>> parse(std::string_view text) {
  const auto path = test_folder() / "lights.json";
  EXPECT_TRUE(write_file_atomic(path, text).ok());
  return load_rigs(path);
}

TEST(Rig, ReadsAllThereIs) {
  const auto rigs = parse(R"({"units": "W", "rigs": [
    {"name": "night", "lights": [
      {"type": "point", "position": [1, 2, 3], "color": [1, 0.5, 0], "intensity": 4},
      {"type": "spot", "position": [0, 0, 0], "direction": [0, -2, 0], "innerConeAngle": 0.1, "outerConeAngle": 0.3},
      {"type": "directional", "direction": [0, 0, 5], "intensity": 2}],
     "emissive": {"lamp": [3, 2, 1]}, "environment": [0.1, 0.2, 0.3]},
    {"name": "dark"}]})");
  ASSERT_TRUE(rigs.ok()) << rigs.status();
  ASSERT_EQ(rigs->size(), 2u);
  const auto night = find_rig(*rigs, "night");
  ASSERT_TRUE(night.ok());
  ASSERT_EQ(night->lights.size(), 3u);
  EXPECT_EQ(night->lights[0].position, (Vec3{1, 2, 3}));
  EXPECT_EQ(night->lights[0].color, (Vec3{1, 0.5f, 0}));
  EXPECT_EQ(night->lights[0].intensity, 4);
  EXPECT_EQ(night->lights[1].direction, (Vec3{0, -1, 0}));
  EXPECT_EQ(night->lights[1].outer_cone_angle, 0.3f);
  EXPECT_EQ(night->lights[2].type, LightType::kDirectional);
  EXPECT_EQ(night->lights[2].direction, (Vec3{0, 0, 1}));
  EXPECT_THAT(std::string(find_rig(*rigs, "day").status().message()), HasSubstr("the file has night, dark"));

  Scene scene;
  scene.lights.resize(5);
  scene.materials.resize(2);
  scene.materials[1].name = "lamp";
  ASSERT_TRUE(apply_rig(*night, &scene).ok());
  EXPECT_EQ(scene.lights.size(), 3u);
  EXPECT_EQ(scene.materials[1].emission, (Vec3{3, 2, 1}));
  EXPECT_EQ(scene.environment, (Vec3{0.1f, 0.2f, 0.3f}));
  ASSERT_TRUE(apply_rig((*rigs)[1], &scene).ok());
  EXPECT_TRUE(scene.lights.empty());
  EXPECT_EQ(scene.environment, (Vec3{0.1f, 0.2f, 0.3f})) << "kept where the rig does not say";
}

TEST(Rig, UnknownMaterialLeavesTheSceneAlone) {
  Rig rig;
  rig.name = "r";
  rig.emission["nowhere"] = {1, 1, 1};
  Scene scene;
  scene.lights.resize(1);
  EXPECT_THAT(std::string(apply_rig(rig, &scene).message()), HasSubstr("\"nowhere\""));
  EXPECT_EQ(scene.lights.size(), 1u);
}

TEST(Rig, Errors) {
  const std::pair<const char*, const char*> cases[] = {
      {"[", "not JSON"},
      {"[]", "\"rigs\""},
      {R"({"rigs": [3]})", "rigs[0] must be an object"},
      {R"({"rigs": [{}]})", "rigs[0].name"},
      {R"({"rigs": [{"name": "a"}, {"name": "a"}]})", "two rigs named \"a\""},
      {R"({"rigs": [{"name": "a", "light": []}]})", "unknown key \"light\""},
      {R"({"rigs": [{"name": "a", "lights": {}}]})", ".lights must be an array"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "laser"}]}]})", "rigs[0] \"a\".lights[0].type"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "point"}]}]})", ".position is missing"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "directional"}]}]})", ".direction is missing"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "point", "position": [1, 2]}]}]})", "array of 3 numbers"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "point", "position": [1, 2, 1e39]}]}]})",
       "position[2] must be a finite"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "point", "position": [1, 2, 1e999]}]}]})", "not JSON"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "directional", "direction": [0, 0, 0]}]}]})",
       "must have a direction"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "point", "position": [0,0,0], "intensity": -1}]}]})",
       "not be negative"},
      {R"({"rigs": [{"name": "a", "lights": [{"type": "spot", "position": [0,0,0], "direction": [0,1,0], "outerConeAngle": 2}]}]})",
       "cone angles"},
      {R"({"rigs": [{"name": "a", "emissive": {"m": [1, "x", 0]}}]})", "emissive.m[1]"},
      {R"({"rigs": [{"name": "a", "environment": [-1, 0, 0]}]})", "environment must not be negative"},
  };
  for (const auto& [text, expected] : cases) {
    const auto rigs = parse(text);
    ASSERT_FALSE(rigs.ok()) << text;
    EXPECT_THAT(std::string(rigs.status().message()), testing::AllOf(HasSubstr(expected), HasSubstr("lights.json")))
        << text;
  }
}

}  // namespace
}  // namespace lightloom
