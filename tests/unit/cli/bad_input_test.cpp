// Levels, assets and disks that are bad: `lightloom` says in one line what is wrong, where, and how to mend it, and writes
// nothing under the final name.
#include <sys/resource.h>

#include <csignal>
#include <limits>

#include "tests/support/program.h"
#include "tests/support/small_disk.h"
#include "tests/unit/scene/gltf_fixture.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;

constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInfinity = std::numeric_limits<float>::infinity();

std::vector<std::string> bake(const std::string& scene, const std::string& loom) {
  return {"bake", scene, "-o", loom, "--texels-per-metre", "2", "--rays", "16", "--relight-rays", "64"};
}

struct BadLevel {
  const char* name;
  const char* what;
  const char* mend;
  std::function<fs::path(const fs::path& folder)> make;
};

std::function<fs::path(const fs::path&)> gltf(const std::function<void(TestGltf*)>& spoil) {
  return [spoil](const fs::path& folder) {
    TestGltf g;
    spoil(&g);
    return g.save(folder);
  };
}
/// The built-in level's bytes, spoiled.
std::function<fs::path(const fs::path&)> glb(const std::function<void(std::string*)>& spoil) {
  return [spoil](const fs::path& folder) {
    std::string bytes = test::text_of(folder / "level.glb");
    spoil(&bytes);
    test::write(folder / "bad.glb", bytes);
    return folder / "bad.glb";
  };
}
void set_positions(TestGltf* g, const std::vector<float>& xyz) {
  g->primitive()["attributes"] = {{"POSITION", g->accessor(xyz, "VEC3", 5126)}};
}

const BadLevel kBadLevels[] = {
    {"Empty", "is empty", "export", glb([](std::string* s) { s->clear(); })},
    {"Truncated", "bad.glb", "export", glb([](std::string* s) { s->resize(s->size() / 2); })},
    {"CutInTheHeader", "bad.glb", "export", glb([](std::string* s) { s->resize(10); })},
    {"CorruptJson", "bad.glb", "export", glb([](std::string* s) { s->replace(40, 8, "\xff{]\n\x01\x02:,"); })},
    {"NotALevel", "bad.glb", "export", glb([](std::string* s) { *s = "These are my holiday notes.\n"; })},
    {"BufferMissing", "missing.bin", "beside", gltf([](TestGltf* g) {
       g->json["buffers"] = {{{"uri", "missing.bin"}, {"byteLength", g->bin.size()}}};
     })},
    {"ImageMissing", "paint.png", "beside", gltf([](TestGltf* g) {
       g->json["images"] = {{{"uri", "paint.png"}}};
       g->json["textures"] = {{{"source", 0}}};
       g->json["materials"] = {{{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}}};
       g->primitive()["material"] = 0;
     })},
    {"UriClimbsOut", "../secret.bin", "copy it there", gltf([](TestGltf* g) {
       g->json["buffers"] = {{{"uri", "../secret.bin"}, {"byteLength", g->bin.size()}}};
     })},
    {"NotANumber", "not a number", "mend the mesh", gltf([](TestGltf* g) {
       set_positions(g, {0, 0, 0, 1, 0, 0, 0, kNan, 0});
     })},
    {"Infinite", "not a number", "mend the mesh", gltf([](TestGltf* g) {
       set_positions(g, {0, 0, 0, 1, 0, 0, 0, kInfinity, 0});
     })},
    {"InfiniteTransform", "not finite", "reset it", gltf([](TestGltf* g) {
       g->json["nodes"][0]["translation"] = {1e300, 0, 0};
     })},
    {"IndexOutOfRange", "index 3 is out of range", "export", gltf([](TestGltf* g) {
       g->primitive()["indices"] = g->accessor(std::vector<uint16_t>{0, 1, 3}, "SCALAR", 5123);
     })},
    {"NoGeometry", "contains no triangles", "give a level with meshes",
     gltf([](TestGltf* g) { g->json["nodes"][0].erase("mesh"); })},
    {"ABillionElements", "more than the limit", "split",
     gltf([](TestGltf* g) { g->json["accessors"][0]["count"] = 1000000000; })},
    {"ABillionElementsOfNothing", "more than the limit", "split", gltf([](TestGltf* g) {
       g->json["accessors"][0]["count"] = 1000000000;
       g->json["accessors"][0].erase("bufferView");
     })},
};

class BadInput : public test::ProgramTest {
 protected:
  /// Nothing is left of what was asked for, nor of the way there.
  void expect_nothing(const fs::path& loom) {
    EXPECT_FALSE(fs::exists(loom / "manifest"));
    for (const auto& file : fs::recursive_directory_iterator(folder_.path())) {
      EXPECT_EQ(file.path().filename().string().find(".tmp"), std::string::npos) << file.path();
    }
  }
};

class BadLevels : public BadInput, public testing::WithParamInterface<BadLevel> {};

TEST_P(BadLevels, AreRefused) {
  const fs::path level = GetParam().make(folder_.path());
  const std::string line = fails(1, bake(level.string(), path("out.loom")), GetParam().what);
  EXPECT_THAT(line, HasSubstr(level.string()));
  EXPECT_THAT(line, HasSubstr(GetParam().mend));
  EXPECT_FALSE(fs::exists(path("out.loom")));
}

INSTANTIATE_TEST_SUITE_P(Bake, BadLevels, testing::ValuesIn(kBadLevels),
                         [](const auto& info) { return std::string(info.param.name); });

TEST_F(BadInput, AFileTooLargeForTheDisksQuota) {
  const auto limit = [] {
    std::signal(SIGXFSZ, SIG_IGN);
    const rlimit small{4096, 4096};
    ::setrlimit(RLIMIT_FSIZE, &small);
  };
  fails(1, bake(scene_, path("out.loom")), path("out.loom"), limit);
  expect_nothing(path("out.loom"));
}

TEST_F(BadInput, AFullDisk) {
  const test::SmallDisk disk(path("small"), "128k");
  if (!disk.mounted()) GTEST_SKIP() << "this user may not mount a small file system to fill";
  test::write(path("small/e.exr"), "old");
  const std::string line = fails(1, bake(scene_, path("small/out.loom")), "no space left");
  EXPECT_THAT(line, HasSubstr(path("small/out.loom")));
  expect_nothing(path("small/out.loom"));
  // What was whole before stays whole.
  fails(1, {"reference", scene_, "-o", path("small/e.exr"), "--samples", "2", "--texels-per-metre", "16"},
        "No space left");
  EXPECT_EQ(test::text_of(path("small/e.exr")), "old");
}

TEST_F(BadInput, AFlippedByteInAnyFileOfAnAsset) {
  const std::string loom = path("level.loom");
  auto one_cell = bake(scene_, loom);
  one_cell.insert(one_cell.end(), {"--cell-receivers", "8192", "--spacing", "5"});
  ASSERT_EQ(run(one_cell).code, 0);
  std::vector<fs::path> files;
  for (const auto& file : fs::recursive_directory_iterator(loom)) {
    if (file.is_regular_file()) files.push_back(file.path());
  }
  ASSERT_GE(files.size(), 4u);
  for (const fs::path& file : files) {
    const std::string whole = test::text_of(file);
    for (const size_t at : {size_t{0}, whole.size() / 3, 2 * whole.size() / 3, whole.size() - 1}) {
      std::string flipped = whole;
      flipped[at] = static_cast<char>(flipped[at] ^ 0x10);
      test::write(file, flipped);
      fails(1, {"verify", loom}, file.filename().string());
    }
    if (!file.filename().string().starts_with("traces-")) {  // those no runtime reads
      EXPECT_THAT(
          fails(1, {"render", loom, scene_, "--lightmap", path("e.exr"), "--device", "simd"}, file.filename().string()),
          HasSubstr("bake"));
      EXPECT_FALSE(fs::exists(path("e.exr")));
    }
    test::write(file, whole);
  }
  EXPECT_EQ(run({"verify", loom}).code, 0);
}

}  // namespace
}  // namespace lightloom
