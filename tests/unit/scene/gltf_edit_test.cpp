// Edits of glTF nodes: the level that is loaded afterwards, and what else the file holds.
#include "core/scene/gltf_edit.h"

#include <gtest/gtest.h>

#include "core/scene/builtin.h"
#include "tests/unit/scene/gltf_fixture.h"

namespace lightloom {
namespace {

Scene reloaded(const GltfEdit& edit, const std::filesystem::path& folder) {
  const absl::Status saved = edit.save(folder / "edited.glb");
  EXPECT_TRUE(saved.ok()) << saved;
  auto scene = load_gltf(folder / "edited.glb");
  EXPECT_TRUE(scene.ok()) << scene.status();
  return scene.ok() ? *std::move(scene) : Scene();
}

const Object* named(const Scene& scene, const std::string& name) {
  for (const Object& o : scene.objects) {
    if (o.name == name) return &o;
  }
  return nullptr;
}

void expect_moved(const Object& from, const Object* to, Vec3 offset) {
  ASSERT_NE(to, nullptr) << from.name;
  ASSERT_EQ(from.positions.size(), to->positions.size());
  for (size_t v = 0; v < from.positions.size(); ++v) {
    EXPECT_LT(length(to->positions[v] - from.positions[v] - offset), 1e-5f) << from.name;
  }
}

/// "arm" turns and stretches what hangs on it: "hand", which has a child "finger"; all show the triangle.
TestGltf hanging() {
  TestGltf g;
  g.json["nodes"] = {{{"name", "arm"},
                      {"rotation", {0, 0, 0.6, 0.8}},
                      {"scale", {2, 3, 0.5}},
                      {"translation", {5, 6, 7}},
                      {"children", {1}}},
                     {{"name", "hand"}, {"mesh", 0}, {"scale", {1, 1, 2}}, {"children", {2}}},
                     {{"name", "finger"}, {"mesh", 0}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 2, 3, 1}}},
                     {{"name", "stone"}, {"mesh", 0}}};
  g.json["scenes"] = {{{"nodes", {0, 3}}}};
  return g;
}

TEST(GltfEdit, MovesInWorldSpaceWithWhatHangsOnIt) {
  const auto folder = test_folder();
  const auto file = hanging().save(folder);
  const Scene before = *load_gltf(file);
  auto edit = GltfEdit::open(file);
  ASSERT_TRUE(edit.ok()) << edit.status();
  const Vec3 step{0.5f, -1, 2};
  ASSERT_TRUE(edit->move(named(before, "hand")->node, step).ok());
  EXPECT_EQ(edit->subtree(1), (std::vector<int>{1, 2}));
  Scene after = reloaded(*edit, folder);
  expect_moved(*named(before, "hand"), named(after, "hand"), step);
  expect_moved(*named(before, "finger"), named(after, "finger"), step);
  expect_moved(*named(before, "stone"), named(after, "stone"), {});

  ASSERT_TRUE(edit->move(2, step).ok());  // which has a matrix
  after = reloaded(*edit, folder);
  expect_moved(*named(before, "finger"), named(after, "finger"), step + step);
  expect_moved(*named(before, "hand"), named(after, "hand"), step);
}

TEST(GltfEdit, AParentThatIsScaledToNothingIsAnError) {
  TestGltf g = hanging();
  g.json["nodes"][0]["scale"] = {0, 1, 1};
  auto edit = GltfEdit::open(g.save(test_folder()));
  ASSERT_TRUE(edit.ok()) << edit.status();
  EXPECT_EQ(edit->move(1, {1, 0, 0}).code(), absl::StatusCode::kFailedPrecondition);
}

TEST(GltfEdit, RemovesOneAndKeepsWhatHangsOnIt) {
  const auto folder = test_folder();
  const auto file = hanging().save(folder);
  const Scene before = *load_gltf(file);
  auto edit = GltfEdit::open(file);
  ASSERT_TRUE(edit->remove(1).ok());
  ASSERT_TRUE(edit->remove(3).ok());
  const Scene after = reloaded(*edit, folder);
  EXPECT_EQ(after.objects.size(), 1u);
  expect_moved(*named(before, "finger"), named(after, "finger"), {});
}

TEST(GltfEdit, DuplicatesInPlaceUnderTheSameParent) {
  const auto folder = test_folder();
  const auto file = hanging().save(folder);
  const Scene before = *load_gltf(file);
  auto edit = GltfEdit::open(file);
  const auto copy = edit->duplicate(1, "hand copy");
  ASSERT_TRUE(copy.ok()) << copy.status();
  Scene after = reloaded(*edit, folder);
  EXPECT_EQ(after.objects.size(), 4u);
  expect_moved(*named(before, "hand"), named(after, "hand copy"), {});
  EXPECT_EQ(named(after, "hand copy")->node, *copy);
  ASSERT_TRUE(edit->move(*copy, {1, 1, 1}).ok());
  after = reloaded(*edit, folder);
  expect_moved(*named(before, "hand"), named(after, "hand copy"), {1, 1, 1});
  expect_moved(*named(before, "hand"), named(after, "hand"), {});
}

TEST(GltfEdit, NothingElseIsLost) {
  const auto folder = test_folder();
  TestGltf g = hanging();
  g.json["extensionsUsed"] = {"ACME_doors"};
  g.json["extensions"]["ACME_doors"] = {{"locked", true}};
  g.json["nodes"][3]["extras"] = {{"price", 12.5}};
  auto edit = GltfEdit::open(g.save(folder));
  ASSERT_TRUE(edit->move(3, {1, 0, 0}).ok());
  ASSERT_TRUE(edit->save(folder / "edited.glb").ok());
  const auto bytes = *read_file(folder / "edited.glb");
  uint32_t length = 0;
  std::memcpy(&length, &bytes[12], 4);
  nlohmann::json saved = nlohmann::json::parse(bytes.begin() + 20, bytes.begin() + 20 + length);
  EXPECT_EQ(saved["nodes"][3]["translation"], (nlohmann::json{1.0, 0.0, 0.0}));
  saved["nodes"][3].erase("translation");
  EXPECT_EQ(saved["extensions"], g.json["extensions"]);
  EXPECT_EQ(saved["nodes"], g.json["nodes"]);
  EXPECT_EQ(saved["accessors"], g.json["accessors"]);
}

TEST(GltfEdit, AGlbKeepsItsBinaryPart) {
  const auto folder = test_folder();
  ASSERT_TRUE(save_gltf(*builtin_scene("flat"), folder / "flat.glb").ok());
  const Scene before = *load_gltf(folder / "flat.glb");
  auto edit = GltfEdit::open(folder / "flat.glb");
  ASSERT_TRUE(edit.ok()) << edit.status();
  const Scene after = reloaded(*edit, folder);
  ASSERT_EQ(after.objects.size(), before.objects.size());
  for (size_t o = 0; o < before.objects.size(); ++o) EXPECT_EQ(after.objects[o].id, before.objects[o].id);
  EXPECT_EQ(after.lights.size(), before.lights.size());
  EXPECT_EQ(after.cameras.size(), before.cameras.size());
}

TEST(GltfEdit, LinkedFilesBindItToItsFolder) {
  const auto folder = test_folder();
  auto edit = GltfEdit::open(hanging().save(folder));  // whose buffer is a file beside it
  ASSERT_TRUE(edit.ok()) << edit.status();
  EXPECT_EQ(reloaded(*edit, folder).objects.size(), 3u);
  std::filesystem::create_directories(folder / "elsewhere");
  EXPECT_EQ(edit->save(folder / "elsewhere" / "edited.glb").code(), absl::StatusCode::kFailedPrecondition);
}

TEST(GltfEdit, BadFilesAndNodesAreErrors) {
  const auto folder = test_folder();
  EXPECT_FALSE(GltfEdit::open(folder / "absent.glb").ok());
  ASSERT_TRUE(write_file_atomic(folder / "bad.gltf", std::string_view("[1, 2")).ok());
  EXPECT_FALSE(GltfEdit::open(folder / "bad.gltf").ok());
  TestGltf g = hanging();
  g.json["nodes"][0]["children"] = "none";
  ASSERT_TRUE(write_file_atomic(folder / "odd.gltf", g.json.dump()).ok());
  EXPECT_FALSE(GltfEdit::open(folder / "odd.gltf").ok());
  auto edit = GltfEdit::open(hanging().save(folder));
  EXPECT_FALSE(edit->move(4, {}).ok());
  EXPECT_FALSE(edit->remove(-1).ok());
  EXPECT_FALSE(edit->duplicate(99, "x").ok());
}

}  // namespace
}  // namespace lightloom
