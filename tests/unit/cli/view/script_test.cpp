#include "cli/view/script.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace lightloom::view {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Script, ReadsEveryCommand) {
  const auto script = parse_script(
      "# a comment, and an empty line\n"
      "\n"
      "wait 10\n"
      "wait-bake\n"
      "camera 1 2 -3.5 90 -10   # where the door is\n"
      "camera \"the hall\"\r\n"
      "light \"lamp 2,2\" 1 2 3\n"
      "light-colour key 1 0.5 0\n"
      "light-power key 40\n"
      "pick \"tall box\"\n"
      "click 0.5 0.25\n"
      "albedo 0.1 0.2 0.3\n"
      "emission 10 0 0\n"
      "\tmove -1 0 1e-2\n"
      "duplicate\n"
      "delete\n"
      "save out.glb\n"
      "rebake\n"
      "cancel-bake\n"
      "reload\n"
      "overlay cells on\n"
      "layer E\n"
      "exposure 0\n"
      "resize 800 600\n"
      "screenshot shot.png\n"
      "quit\n"
      "wait-reload\n"
      "wait-arrival");
  ASSERT_TRUE(script.ok()) << script.status();
  std::vector<Verb> verbs;
  for (const Action& action : *script) verbs.push_back(action.verb);
  std::vector<Verb> all;
  for (int v = 0; v <= static_cast<int>(Verb::kQuit); ++v) all.push_back(static_cast<Verb>(v));
  EXPECT_THAT(verbs, ::testing::UnorderedElementsAreArray(all));
  EXPECT_EQ((*script)[0].line, 3);
  EXPECT_THAT((*script)[2].numbers, ElementsAre(1, 2, -3.5f, 90, -10));
  EXPECT_EQ((*script)[3].name, "the hall");
  EXPECT_EQ((*script)[4].name, "lamp 2,2");
  EXPECT_EQ((*script)[4].vec3(), (Vec3{1, 2, 3}));
  EXPECT_TRUE((*script)[18].on);
}

TEST(Script, ErrorsNameTheLineAndWhatIsWrong) {
  const std::pair<const char*, const char*> kBad[] = {
      {"wait", "wait FRAMES"},
      {"wait ten", "'ten' is not a number"},
      {"wait 10x", "'10x' is not a number"},
      {"wait 0", "must be 1 to"},
      {"wait -1", "must be 1 to"},
      {"wait nan", "not a number"},
      {"fly 1 2 3", "'fly' is not a command; there are wait"},
      {"camera 1 2 3", "camera x y z yaw pitch or camera NAME"},
      {"light key 1 2", "light NAME x y z"},
      {"light \"key 1 2 3", "a quote is not closed"},
      {"albedo 2 0 0", "must be 0 to 1"},
      {"emission -1 0 0", "must be at least 0"},
      {"overlay clouds on", "no overlay 'clouds'; there are cells"},
      {"overlay cells maybe", "on or off"},
      {"layer sheet", "no layer 'sheet'; there are full"},
      {"screenshot a.jpg", "must end in .png"},
      {"save a.gltf", ".glb"},
      {"pick \"\"", "a name is empty"},
      {"click 0.5 1.5", "must be 0 to 1"},
      {"quit now", "it must be: quit"},
  };
  for (const auto& bad : kBad) {
    const auto script = parse_script(std::string("wait 1\n\n") + bad.first + "\nquit\n");
    EXPECT_EQ(script.status().code(), absl::StatusCode::kInvalidArgument) << bad.first;
    EXPECT_THAT(std::string(script.status().message()), ::testing::StartsWith("line 3: ")) << bad.first;
    EXPECT_THAT(std::string(script.status().message()), HasSubstr(bad.second)) << bad.first;
  }
}

TEST(Script, NothingIsNoError) {
  EXPECT_TRUE(parse_script("")->empty());
  EXPECT_TRUE(parse_script("\n  # nothing\n")->empty());
}

}  // namespace
}  // namespace lightloom::view
