// A level in the runtime that is painted and edited, without a window, under the validation layers.
#include "cli/view/live_level.h"

#include <gtest/gtest.h>

#include "core/scene/builtin.h"
#include "core/scene/gltf.h"
#include "tests/support/baked_level.h"

namespace lightloom::view {
namespace {

class LiveLevelTest : public ::testing::Test {
 protected:
  void SetUp() override {
    files_.scene = (folder_.path() / "level.glb").string();
    ASSERT_TRUE(save_gltf(*builtin_scene("cornell"), files_.scene).ok());
    const Scene scene = *load_gltf(files_.scene);
    BakeParams params;
    params.texels_per_metre = 2;
    params.rays = 16;
    params.relight_rays = 64;
    files_.loom = (folder_.path() / "level.loom").string();
    const auto tracer = std::move(*RayTracer::create(scene));
    ASSERT_TRUE(bake(*tracer, params, files_.loom, {}).ok());
    gpu_ = std::move(*renderer::Gpu::create(/*validation=*/true));
    load();
    arrive();
  }
  void load() {
    auto level = LiveLevel::load(gpu_.get(), files_, 256);
    ASSERT_TRUE(level.ok()) << level.status();
    level_ = std::move(*level);
  }
  void load_again(const std::string& scene) {
    auto level = LiveLevel::load_again(level_.get(), scene);
    ASSERT_TRUE(level.ok()) << level.status();
    level_ = std::move(*level);
  }
  size_t object(const std::string& name) const {
    const auto& objects = level_->scene().objects;
    for (size_t o = 0; o < objects.size(); ++o) {
      if (objects[o].name == name) return o;
    }
    ADD_FAILURE() << "no object " << name;
    return 0;
  }
  void frame() {
    renderer::Renderer& r = level_->renderer();
    const absl::Status status = gpu_->run([&](VkCommandBuffer commands) {
      return r.record(commands, [&](VkCommandBuffer c) { return level_->runtime().record(r, c); });
    });
    EXPECT_TRUE(status.ok()) << status;
  }
  /// Frames until all is there.
  void arrive() {
    picture();
    for (int i = 0; i < 200; ++i) {
      ASSERT_TRUE(level_->runtime().look_from({2.7f, 2.7f, 0}, {}).ok());
      frame();
      if (!level_->runtime().arriving()) return;
    }
    FAIL() << "it does not arrive";
  }
  /// After some bounces.
  Image picture(Layer layer = Layer::kFull, int frames = 6) {
    renderer::Renderer& r = level_->renderer();
    const Camera camera = level_->scene().cameras[0];
    EXPECT_TRUE(r.set_size(64, 64).ok());
    EXPECT_TRUE(r.set_view(camera, layer).ok());
    for (int i = 0; i < frames; ++i) frame();
    auto image = r.read();
    EXPECT_TRUE(image.ok()) << image.status();
    return *std::move(image);
  }
  static double sum(const Image& image, const char* channel) {
    double all = 0;
    for (const float v : *image.channel(channel)) all += static_cast<double>(v);
    return all;
  }

  test::TemporaryFolder folder_;
  LevelFiles files_;
  std::unique_ptr<renderer::Gpu> gpu_;
  std::unique_ptr<LiveLevel> level_;
};

TEST_F(LiveLevelTest, APaintedWallColoursTheIndirectLight) {
  const Image before = picture(Layer::kE);
  ASSERT_TRUE(level_->set_albedo(object("left"), {0.02f, 0.02f, 0.9f}).ok());
  const Image after = picture(Layer::kE);
  EXPECT_LT(sum(after, "R"), 0.97 * sum(before, "R"));
  EXPECT_GT(sum(after, "B"), 1.02 * sum(before, "B"));
  EXPECT_EQ(level_->material(object("right")).base_color, builtin_scene("cornell")->materials[2].base_color);
}

TEST_F(LiveLevelTest, AShiningBoxLightsTheRoom) {
  const Image before = picture(Layer::kE);
  ASSERT_TRUE(level_->set_emission(object("short box"), {5, 5, 5}).ok());
  EXPECT_GT(sum(picture(Layer::kE), "G"), 1.2 * sum(before, "G"));
}

TEST_F(LiveLevelTest, PaintAndLightOutliveAReload) {
  ASSERT_TRUE(level_->set_albedo(object("left"), {0.1f, 0.2f, 0.9f}).ok());
  level_->lights()[0].position = {1, 2, 3};
  for (int i = 0; i < 5; ++i) picture();
  const Image painted = picture(Layer::kE);
  load_again(files_.scene);
  EXPECT_EQ(level_->scene().lights[0].position, (Vec3{1, 2, 3}));
  // Not black: all goes on as it was lit, but where bases have come, of a bake so coarse that they are half too bright.
  const Image at_once = picture(Layer::kE, 1);
  EXPECT_NEAR(sum(at_once, "B"), sum(painted, "B"), 0.6 * sum(painted, "B"));
  arrive();
  for (int i = 0; i < 8; ++i) picture();
  const Image again = picture(Layer::kE);
  EXPECT_NEAR(sum(again, "B"), sum(painted, "B"), 2e-3 * sum(painted, "B"));
}

TEST_F(LiveLevelTest, ARebakeOfAnEditedLevelArrives) {
  ASSERT_TRUE(level_->move(object("tall box"), {0.5f, 0, 0.3f}).ok());
  ASSERT_TRUE(level_->remove(object("short box")).ok());
  const std::string edited = (folder_.path() / "edited.glb").string();
  ASSERT_TRUE(level_->save(edited).ok());
  const Scene scene = *load_gltf(edited);
  const auto tracer = std::move(*RayTracer::create(scene));
  ASSERT_TRUE(bake(*tracer, level_->manifest().params, files_.loom, {}).ok());
  load_again(edited);
  EXPECT_EQ(level_->scene().objects.size(), builtin_scene("cornell")->objects.size() - 1);
  arrive();
  for (int i = 0; i < 5; ++i) picture();
  const Image kept = picture();
  files_.scene = edited;
  load();
  arrive();
  for (int i = 0; i < 5; ++i) picture();
  const Image fresh = picture();
  EXPECT_NEAR(sum(kept, "G"), sum(fresh, "G"), 1e-3 * sum(fresh, "G"));
}

TEST_F(LiveLevelTest, ALevelThatIsNotTheBakedOneLeavesTheOldOneAlone) {
  const std::string other = (folder_.path() / "other.glb").string();
  ASSERT_TRUE(save_gltf(*builtin_scene("flat"), other).ok());
  EXPECT_FALSE(LiveLevel::load_again(level_.get(), other).ok());
  EXPECT_FALSE(LiveLevel::load_again(level_.get(), "none.glb").ok());
  picture();
}

TEST_F(LiveLevelTest, AMovedBoxIsSeenPickedAndSavedWhereItIs) {
  const size_t box = object("short box");
  const Aabb before = level_->bounds(box);
  const Image still = picture(Layer::kDirect);
  ASSERT_TRUE(level_->move(box, {0.25f, 1.5f, -0.5f}).ok());
  EXPECT_TRUE(level_->edited());
  EXPECT_LT(length(level_->bounds(box).center() - before.center() - Vec3{0.25f, 1.5f, -0.5f}), 1e-4f);
  EXPECT_NE(picture(Layer::kDirect).channels[0].values, still.channels[0].values);

  const auto tracer = level_->tracer();
  ASSERT_TRUE(tracer.ok()) << tracer.status();
  const Vec3 above = level_->bounds(box).center() + Vec3{0, 0.5f * level_->bounds(box).size().y + 0.1f, 0};
  EXPECT_EQ((*tracer)->closest(above, {0, -1, 0}).object, box);

  const std::string saved = (folder_.path() / "moved.glb").string();
  ASSERT_TRUE(level_->save(saved).ok());
  EXPECT_FALSE(level_->edited());
  const auto scene = load_gltf(saved);
  ASSERT_TRUE(scene.ok()) << scene.status();
  for (size_t v = 0; v < scene->objects[box].positions.size(); ++v) {
    EXPECT_LT(length(scene->objects[box].positions[v] - level_->scene().objects[box].positions[v]), 1e-5f);
  }
}

TEST_F(LiveLevelTest, CopiesAndHolesAreSeenAndSaved) {
  const size_t objects = level_->scene().objects.size();
  const auto copy = level_->duplicate(object("short box"));
  ASSERT_TRUE(copy.ok()) << copy.status();
  EXPECT_EQ(level_->scene().objects[*copy].name, "short box copy");
  ASSERT_TRUE(level_->move(*copy, {0, 2, 0}).ok());
  ASSERT_TRUE(level_->set_albedo(*copy, {1, 0, 0}).ok());
  ASSERT_TRUE(level_->remove(object("tall box")).ok());
  EXPECT_FALSE(level_->exists(object("tall box")));
  picture();
  const std::string saved = (folder_.path() / "edited.glb").string();
  ASSERT_TRUE(level_->save(saved).ok());
  const auto scene = load_gltf(saved);
  ASSERT_TRUE(scene.ok()) << scene.status();
  EXPECT_EQ(scene->objects.size(), objects);
  size_t found = 0;
  for (const Object& o : scene->objects) {
    EXPECT_NE(o.name, "tall box");
    found += o.name == "short box copy" || o.name == "short box" ? 1 : 0;
  }
  EXPECT_EQ(found, 2u);
}

TEST_F(LiveLevelTest, PaintOfOneIsNotThatOfItsCopy) {
  const size_t box = object("short box");
  ASSERT_TRUE(level_->set_albedo(box, {0, 1, 0}).ok());
  const size_t copy = *level_->duplicate(box);
  EXPECT_EQ(level_->material(copy).base_color, (Vec3{0, 1, 0}));
  ASSERT_TRUE(level_->set_albedo(box, {1, 0, 0}).ok());
  EXPECT_EQ(level_->material(copy).base_color, (Vec3{0, 1, 0}));
  ASSERT_TRUE(level_->set_albedo(copy, {0, 0, 1}).ok());
  EXPECT_EQ(level_->material(box).base_color, (Vec3{1, 0, 0}));
}

TEST_F(LiveLevelTest, TheLastObjectStays) {
  for (size_t o = 1; o < level_->scene().objects.size(); ++o) ASSERT_TRUE(level_->remove(o).ok());
  EXPECT_EQ(level_->remove(0).code(), absl::StatusCode::kFailedPrecondition);
  picture();
}

}  // namespace
}  // namespace lightloom::view
