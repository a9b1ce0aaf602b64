#include "cli/view/child_bake.h"

#include <gtest/gtest.h>
#include <poll.h>

#include <filesystem>
#include <fstream>

#include "tests/support/baked_level.h"

namespace lightloom::view {
namespace {

/// A program that says `script` does, as /bin/sh runs it.
class FakeBake : public ::testing::Test {
 protected:
  std::string program(const std::string& script) {
    const std::string path = (folder_.path() / "fake").string();
    std::ofstream(path) << "#!/bin/sh\n" << script << "\n";
    std::filesystem::permissions(path, std::filesystem::perms::owner_all);
    return path;
  }
  void wait(ChildBake* bake) {
    while (!bake->poll()) ASSERT_EQ(::poll(nullptr, 0, 1), 0);
  }
  test::TemporaryFolder folder_;
};

TEST(BakeProgress, ReadsItsLinesAndNoOthers) {
  BakeProgress p;
  ASSERT_TRUE(parse_progress("progress bake 12 40", &p));
  EXPECT_EQ(p.stage, "bake");
  EXPECT_EQ(p.done, 12u);
  EXPECT_EQ(p.total, 40u);
  ASSERT_TRUE(parse_progress("progress find receivers 1 2", &p));
  EXPECT_EQ(p.stage, "find receivers");
  for (const char* other :
       {"", "progress", "progress bake", "progress bake 1", "progress bake one two", "warning: x"}) {
    EXPECT_FALSE(parse_progress(other, &p)) << other;
  }
}

TEST_F(FakeBake, IsGivenTheLevelAndShowsItsProgress) {
  ChildBake bake;
  const std::string said = (folder_.path() / "said").string();
  ASSERT_TRUE(
      bake.start(program("echo \"$@\" > " + said + "; echo 'progress bake 3 4' >&2"), "a b.glb", "x.loom").ok());
  EXPECT_TRUE(bake.running());
  wait(&bake);
  EXPECT_FALSE(bake.running());
  EXPECT_TRUE(bake.result().ok()) << bake.result();
  EXPECT_EQ(bake.progress().done, 3u);
  std::ifstream in(said);
  std::string line;
  std::getline(in, line);
  EXPECT_EQ(line, "bake a b.glb -o x.loom --progress");
}

TEST_F(FakeBake, AFailureIsItsLastLine) {
  ChildBake bake;
  ASSERT_TRUE(bake.start(program("echo 'lightloom: the level is empty; fill it' >&2; exit 1"), "a", "b").ok());
  wait(&bake);
  EXPECT_EQ(bake.result().message(), "the level is empty; fill it");
}

TEST_F(FakeBake, IsCancelledAndMayBeStartedAgain) {
  ChildBake bake;
  ASSERT_TRUE(bake.start(program("echo 'progress bake 1 2' >&2; exec sleep 1000 2>/dev/null"), "a", "b").ok());
  bake.cancel();
  wait(&bake);
  EXPECT_EQ(bake.result().code(), absl::StatusCode::kCancelled);
  ASSERT_TRUE(bake.start(program("exit 0"), "a", "b").ok());
  wait(&bake);
  EXPECT_TRUE(bake.result().ok());
}

TEST_F(FakeBake, EndsWithItsOwner) {
  ChildBake bake;
  ASSERT_TRUE(bake.start(program("exec sleep 1000"), "a", "b").ok());
}

TEST_F(FakeBake, AProgramThatIsNotThere) {
  ChildBake bake;
  EXPECT_FALSE(bake.start((folder_.path() / "nothing").string(), "a", "b").ok());
  EXPECT_FALSE(bake.running());
}

}  // namespace
}  // namespace lightloom::view
