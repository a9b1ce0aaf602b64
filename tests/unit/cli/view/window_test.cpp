// `lightloom view` in a window, on a display that the test starts, under the validation layers; told what to do by scripts.
#include <stb/stb_image.h>

#include <cmath>
#include <cstdlib>
#include <memory>

#include "core/scene/gltf.h"
#include "tests/support/display.h"
#include "tests/support/program.h"

namespace lightloom {
namespace {

using ::testing::HasSubstr;

constexpr int kWidth = 320, kHeight = 240;

struct Pixels {
  int width = 0, height = 0;
  std::vector<uint8_t> rgb;
};

Pixels read_png(const std::string& path) {
  Pixels p;
  int channels = 0;
  const std::unique_ptr<uint8_t, decltype(&stbi_image_free)> data(
      stbi_load(path.c_str(), &p.width, &p.height, &channels, 3), stbi_image_free);
  if (data) p.rgb.assign(data.get(), data.get() + static_cast<size_t>(p.width) * static_cast<size_t>(p.height) * 3);
  EXPECT_TRUE(data) << path;
  return p;
}

/// Mean difference of the two, in steps of 1/255; a large number if they have not one size.
double difference(const Pixels& a, const Pixels& b) {
  EXPECT_EQ(a.rgb.size(), b.rgb.size());
  if (a.rgb.size() != b.rgb.size() || a.rgb.empty()) return 255;
  double sum = 0;
  for (size_t i = 0; i < a.rgb.size(); ++i) sum += std::abs(int{a.rgb[i]} - int{b.rgb[i]});
  return sum / static_cast<double>(a.rgb.size());
}

class ViewWindow : public test::ProgramTest {
 protected:
  void SetUp() override {
    test::ProgramTest::SetUp();
    if (!test::Display::installed()) GTEST_SKIP() << "there is no Xvfb: deploy/install-deps --tests";
    // A camera of the window's shape, so that `lightloom render` draws the same picture.
    Scene scene = *builtin_scene("cornell");
    scene.cameras[0].aspect = static_cast<float>(kWidth) / kHeight;
    ASSERT_TRUE(save_gltf(scene, scene_).ok());
    display_ = std::make_unique<test::Display>();
    ASSERT_FALSE(display_->name().empty());
  }

  /// Runs the viewer with these commands and options.
  Result view(const std::string& script, const std::vector<std::string>& more = {}) {
    test::write(path("script.txt"), script);
    std::vector<std::string> arguments = {"view",
                                          loom_,
                                          scene_,
                                          "--script",
                                          path("script.txt"),
                                          "--validation",
                                          "--width",
                                          std::to_string(kWidth),
                                          "--height",
                                          std::to_string(kHeight),
                                          "--shadow-size",
                                          "512"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    return finish(start(arguments, "", [this] { ::setenv("DISPLAY", display_->name().c_str(), 1); }));
  }
  void views(const std::string& script, const std::vector<std::string>& more = {}) {
    const Result r = view(script, more);
    EXPECT_EQ(r.code, 0) << r.err;
    EXPECT_EQ(r.err, "");
  }
  Pixels shot(const std::string& name) { return read_png(path(name)); }

  std::unique_ptr<test::Display> display_;
  std::string loom_;
};

TEST_F(ViewWindow, ShowsWhatRenderDraws) {
  loom_ = baked();
  views("screenshot first.png\nquit\n", {"--no-panel"});
  const Result r = run({"render", loom_, scene_, "-o", path("render.png"), "--width", std::to_string(kWidth),
                        "--samples", "1", "--shadow-size", "512"});
  ASSERT_EQ(r.code, 0) << r.err;
  EXPECT_EQ(shot("first.png").width, kWidth);
  EXPECT_LT(difference(shot("first.png"), shot("render.png")), 0.5);
}

TEST_F(ViewWindow, FollowsLightsColoursCamerasAndLayers) {
  loom_ = baked();
  views(
      "screenshot first.png\n"
      "light key 1 2 1\nwait 8\nscreenshot light.png\n"
      "light-colour key 1 0.2 0.1\nlight-power key 40\nwait 8\nscreenshot colour.png\n"
      "pick left\nalbedo 0.1 0.1 0.9\nemission 0 0 2\nwait 8\nscreenshot painted.png\n"
      "camera 2.8 4 -3 180 -20\nscreenshot camera.png\n"
      "camera front\nlayer E\nscreenshot layer.png\n"
      "layer full\nexposure 0\nwait 1\nscreenshot exposed.png\n",
      {"--no-panel", "--screenshot", path("last.png")});
  const char* const kInOrder[] = {"first.png", "light.png", "colour.png", "painted.png", "camera.png", "layer.png"};
  for (size_t i = 1; i < std::size(kInOrder); ++i) {
    EXPECT_GT(difference(shot(kInOrder[i - 1]), shot(kInOrder[i])), 3) << kInOrder[i];
  }
  EXPECT_GT(difference(shot("painted.png"), shot("exposed.png")), 1);
  EXPECT_LT(difference(shot("exposed.png"), shot("last.png")), 0.5);
}

TEST_F(ViewWindow, DrawsOverlaysAndPanelAndFitsANewSize) {
  loom_ = baked();
  views(
      "screenshot panel.png\n"
      "overlay panel off\noverlay lights off\nwait 1\nscreenshot bare.png\n"
      "overlay cells on\nscreenshot cells.png\noverlay cells off\n"
      "overlay ranks on\nscreenshot ranks.png\noverlay ranks off\n"
      "overlay probes on\nscreenshot probes.png\noverlay probes off\n"
      "overlay stale on\nscreenshot stale.png\noverlay stale off\n"
      "wait 1\nscreenshot again.png\n"
      "resize 400 200\nscreenshot wide.png\nquit\n");
  for (const char* name : {"panel.png", "cells.png", "ranks.png", "probes.png", "stale.png"}) {
    EXPECT_GT(difference(shot("bare.png"), shot(name)), 0.1) << name;
  }
  EXPECT_LT(difference(shot("bare.png"), shot("again.png")), 0.5);
  EXPECT_EQ(shot("wide.png").width, 400);
  EXPECT_EQ(shot("wide.png").height, 200);
}

TEST_F(ViewWindow, EditsAreSavedBakedAndShown) {
  loom_ = baked();
  views(
      "screenshot first.png\n"
      "click 0.6 0.75\n"  // the short box
      "move 0 1 0\nduplicate\nmove -1.5 0 0\n"
      "pick \"tall box\"\ndelete\nwait 8\nscreenshot edited.png\n"
      "rebake\nwait-bake\nwait-arrival\nwait 26\nscreenshot baked.png\nquit\n",
      {"--no-panel", "--save-as", path("mine.glb")});
  EXPECT_GT(difference(shot("first.png"), shot("edited.png")), 3);
  EXPECT_GT(difference(shot("edited.png"), shot("baked.png")), 0.5);
  const auto scene = load_gltf(path("mine.glb"));
  ASSERT_TRUE(scene.ok()) << scene.status();
  std::vector<std::string> names;
  for (const Object& o : scene->objects) names.push_back(o.name);
  EXPECT_THAT(names, ::testing::Contains("short box copy"));
  EXPECT_THAT(names, ::testing::Not(::testing::Contains("tall box")));
  EXPECT_EQ(run({"verify", loom_, "--scene", path("mine.glb")}).code, 0);

  const Result r = run({"render", loom_, path("mine.glb"), "-o", path("render.png"), "--width", std::to_string(kWidth),
                        "--samples", "1", "--shadow-size", "512", "--exposure", "1"});
  ASSERT_EQ(r.code, 0) << r.err;
  scene_ = path("mine.glb");
  views("screenshot same.png\nquit\n", {"--no-panel", "--exposure", "1"});
  EXPECT_LT(difference(shot("same.png"), shot("render.png")), 0.5);
}

TEST_F(ViewWindow, ReloadDropsWhatWasEdited) {
  loom_ = baked();
  views("screenshot first.png\npick \"tall box\"\nmove 1 0 -1\nsave " + path("moved.glb") +
            "\nwait 4\nscreenshot moved.png\nreload\nwait-arrival\nwait 26\nscreenshot again.png\nquit\n",
        {"--no-panel"});
  EXPECT_GT(difference(shot("first.png"), shot("moved.png")), 2);
  EXPECT_LT(difference(shot("first.png"), shot("again.png")), 0.5);
}

TEST_F(ViewWindow, ACancelledBakeLeavesTheAssetAsItWas) {
  loom_ = baked();
  views("pick \"tall box\"\nmove 0.5 0 0\nrebake\ncancel-bake\nwait-bake\nquit\n", {"--no-panel"});
  EXPECT_EQ(run({"verify", loom_, "--scene", scene_}).code, 0);
  EXPECT_TRUE(std::filesystem::exists(path("level-edited.glb")));
}

TEST_F(ViewWindow, MistakesOfAScriptAreNamedByTheirLine) {
  loom_ = baked();
  const std::pair<const char*, const char*> kMistakes[] = {
      {"wait 1\npick nobody\n", "line 2: the level has no object 'nobody'"},
      {"light nobody 1 2 3\n", "line 1: the level has no light 'nobody'"},
      {"camera nobody\n", "line 1: the level has no camera 'nobody'"},
      {"\n\nmove 1 0 0\n", "line 3: no object is picked"},
  };
  for (const auto& mistake : kMistakes) {
    const Result r = view(mistake.first);
    EXPECT_EQ(r.code, 1);
    EXPECT_THAT(r.err, HasSubstr(mistake.second));
    EXPECT_EQ(std::count(r.err.begin(), r.err.end(), '\n'), 1) << r.err;
  }
}

TEST_F(ViewWindow, BadArgumentsAreSaidBeforeAWindowOpens) {
  loom_ = baked();
  const Result bad = view("wait 1\nfly away\n");
  EXPECT_EQ(bad.code, 2);
  EXPECT_THAT(bad.err, HasSubstr("script.txt line 2: 'fly' is not a command"));
  EXPECT_EQ(view("save " + scene_ + "\n").code, 2);
  EXPECT_EQ(view("quit\n", {"--camera", "nobody"}).code, 1);
  EXPECT_EQ(view("quit\n", {"--exposure", "-1"}).code, 2);
}

TEST_F(ViewWindow, WithoutADisplayItSaysSo) {
  loom_ = baked();
  for (const char* display : {"", ":9999"}) {
    fails(1, {"view", loom_, scene_}, "no display: set DISPLAY, or use lightloom render", [display] {
      ::unsetenv("WAYLAND_DISPLAY");
      ::setenv("DISPLAY", display, 1);
    });
  }
}

}  // namespace
}  // namespace lightloom
