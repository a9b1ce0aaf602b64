#include "core/bake/load_glb.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "core/base/file.h"
#include "core/scene/gltf.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

TEST(LoadGlb, AsFromTheFile) {
  const test::TemporaryFolder folder;
  ASSERT_TRUE(save_gltf(test::room_with_crate(), folder.path() / "room.glb").ok());
  const Scene of_file = test::value_or_die(load_gltf(folder.path() / "room.glb"));
  const Scene of_bytes = test::value_or_die(load_glb(test::value_or_die(read_file(folder.path() / "room.glb"))));
  ASSERT_EQ(of_bytes.objects.size(), of_file.objects.size());
  for (size_t o = 0; o < of_file.objects.size(); ++o) EXPECT_EQ(of_bytes.objects[o].id, of_file.objects[o].id);
}

TEST(LoadGlb, ErrorsNameNoTemporaryFile) {
  const std::vector<uint8_t> garbage(100, 'x');
  const auto result = load_glb(garbage);
  ASSERT_FALSE(result.ok());
  EXPECT_THAT(std::string(result.status().message()), HasSubstr("level.glb"));
  EXPECT_THAT(std::string(result.status().message()), Not(HasSubstr(std::filesystem::temp_directory_path().string())));
}

TEST(LoadGlb, LeavesNothingBehind) {
  const test::TemporaryFolder folder;
  const char* before = std::getenv("TMPDIR");
  const std::string old = before == nullptr ? "" : before;
  ::setenv("TMPDIR", folder.path().c_str(), 1);
  EXPECT_FALSE(load_glb(std::vector<uint8_t>(100, 'x')).ok());
  EXPECT_TRUE(std::filesystem::is_empty(folder.path()));
  ::setenv("TMPDIR", (folder.path() / "missing").c_str(), 1);
  EXPECT_THAT(std::string(load_glb(std::vector<uint8_t>(100, 'x')).status().message()), HasSubstr("TMPDIR"));
  if (before == nullptr) {
    ::unsetenv("TMPDIR");
  } else {
    ::setenv("TMPDIR", old.c_str(), 1);
  }
}

}  // namespace
}  // namespace lightloom
