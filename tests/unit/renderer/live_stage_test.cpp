// The whole of it on small levels: bake, light on the renderer's device, draw; and the example engine as a program. Under
// the validation layers, of which every message is an error.
#include <gtest/gtest.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <vector>

#include "cli/scene_edit.h"
#include "cli/stage.h"
#include "core/reference/compare.h"
#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

/// Cornell's box in coarse texels, baked once for all tests.
const test::BakedLevel& cornell() {
  static const std::unique_ptr<test::BakedLevel> level = [] {
    BakeParams params;
    params.texels_per_metre = 3;
    params.rays = 64;
    params.relight_rays = 1024;
    return test::bake_level(*builtin_scene("cornell"), params);
  }();
  return *level;
}

/// A fresh copy of the level's scene, lit.
struct Lit {
  Level level;
  ProgressBar bar;
  std::unique_ptr<Stage> stage;

  explicit Lit(StageOptions options, const std::string& albedo = "") {
    level.scene = std::make_unique<Scene>(*builtin_scene("cornell"));
    EXPECT_TRUE(set_albedo(albedo, level.scene.get()).ok());
    level.tracer = std::move(*RayTracer::create(*level.scene));
    options.loom = cornell().loom().string();
    options.validation = true;
    auto made = Stage::create(level, options, &bar);
    EXPECT_TRUE(made.ok()) << made.status();
    stage = std::move(*made);
  }
  void light() {
    const absl::Status status = stage->light();
    ASSERT_TRUE(status.ok()) << status;
  }
  Image picture(Layer layer = Layer::kFull) {
    auto image = stage->picture(level.scene->cameras[0], {layer, 96, 4});
    EXPECT_TRUE(image.ok()) << image.status();
    return std::move(*image);
  }
  Image lightmap() {
    auto image = stage->lightmap();
    EXPECT_TRUE(image.ok()) << image.status();
    return std::move(*image);
  }
};

StageOptions live(int bounces = 6) {
  StageOptions options;
  options.bounces = bounces;
  options.shadow_size = 1024;
  return options;
}

double rel_rmse(const Image& a, const Image& b) {
  auto result = compare(a, b, {});
  EXPECT_TRUE(result.ok()) << result.status();
  return result->rel_rmse;
}

TEST(LiveStage, EEqualsThatOfRays) {
  Lit shadows(live());
  shadows.light();
  StageOptions options = live();
  options.direct = DirectSource::kRays;
  Lit rays(options);
  rays.light();
  options.player = Player::kDecoder;
  Lit cpu(options);
  cpu.light();
  EXPECT_LT(rel_rmse(rays.lightmap(), cpu.lightmap()), 1e-3);
  EXPECT_LT(rel_rmse(shadows.lightmap(), cpu.lightmap()), 0.02);
  EXPECT_LT(rel_rmse(shadows.picture(), cpu.picture()), 0.06);  // edges
  EXPECT_LT(rel_rmse(shadows.picture(Layer::kIndirect), cpu.picture(Layer::kIndirect)), 0.06);
}

TEST(LiveStage, OneBounceNeedsNoPictureFirst) {
  Lit shadows(live(1));
  shadows.light();
  StageOptions options = live(1);
  options.player = Player::kDecoder;
  Lit cpu(options);
  cpu.light();
  EXPECT_LT(rel_rmse(shadows.lightmap(), cpu.lightmap()), 0.02);
}

TEST(LiveStage, NoBouncesAreDirectLightAlone) {
  Lit lit(live(0));
  lit.light();
  const Image full = lit.picture(), direct = lit.picture(Layer::kDirect);
  for (size_t c = 0; c < 3; ++c) EXPECT_EQ(full.channels[c].values, direct.channels[c].values);
}

TEST(LiveStage, AMovingLightIsFollowedAndTheWayBackGivesTheSamePicture) {
  Lit lit(live(24));
  lit.light();
  const Image start = lit.picture();
  const Vec3 home = lit.level.scene->lights[0].position;
  lit.level.scene->lights[0].position = home + Vec3{1, -2, 0};
  lit.light();
  const Image moved = lit.picture(), moved_e = lit.picture(Layer::kE);
  EXPECT_GT(rel_rmse(moved, start), 0.1);
  Lit fresh(live(24));
  fresh.level.scene->lights[0].position = home + Vec3{1, -2, 0};
  fresh.light();
  EXPECT_LT(rel_rmse(moved_e, fresh.picture(Layer::kE)), 1e-3);  // no light of the old place is left
  lit.level.scene->lights[0].position = home;
  lit.light();
  EXPECT_LT(rel_rmse(lit.picture(), start), 1e-3);
}

TEST(LiveStage, SameInputSameBytes) {
  Lit a(live()), b(live());
  a.light();
  b.light();
  const Image pa = a.picture(), pb = b.picture();
  for (size_t c = 0; c < 3; ++c) EXPECT_EQ(pa.channels[c].values, pb.channels[c].values);
}

TEST(LiveStage, ANewColourNeedsNoBake) {
  Lit before(live()), after(live(), "left:0.02,0.5,0.02");
  before.light();
  after.light();
  const Image e = before.lightmap(), green = after.lightmap();
  double red_before = 0, red_after = 0;
  for (const float v : *e.channel("R")) red_before += v;
  for (const float v : *green.channel("R")) red_after += v;
  EXPECT_LT(red_after, 0.97 * red_before);  // the red that the wall sent is gone
  StageOptions options = live();
  options.player = Player::kDecoder;
  Lit cpu(options, "left:0.02,0.5,0.02");
  cpu.light();
  EXPECT_LT(rel_rmse(green, cpu.lightmap()), 0.02);
}

TEST(Example, MinimalEngineLightsAMovingLamp) {
  const test::TemporaryFolder folder;
  const std::string out = (folder.path() / "E").string(), log = (folder.path() / "log").string();
  const std::string command =
      "VK_INSTANCE_LAYERS=VK_LAYER_KHRONOS_validation "
      "VK_LAYER_ENABLES=VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT " LIGHTLOOM_MINIMAL_ENGINE " '" +
      cornell().loom().string() + "' '" + out + "' 6 1 4 2 4.5 4 2 > '" + log + "' 2>&1";
  const int code = std::system(command.c_str());
  std::ifstream in(log);
  const std::string said((std::istreambuf_iterator<char>(in)), {});
  ASSERT_EQ(code, 0) << said;
  EXPECT_EQ(said.find("alidation"), std::string::npos) << said;

  std::istringstream lines(said);
  std::vector<double> means;
  for (std::string line; std::getline(lines, line);) {
    const size_t at = line.find("mean E ");
    ASSERT_NE(at, std::string::npos) << line;
    means.push_back(std::stod(line.substr(at + 7)));
  }
  ASSERT_EQ(means.size(), 6u);
  EXPECT_GT(means.back(), 0.01);
  EXPECT_NE(means[4], means[5]);
  EXPECT_EQ(std::filesystem::file_size(out + "_0000.ppm"), std::filesystem::file_size(out + "_0005.ppm"));
}

}  // namespace
}  // namespace lightloom
