#include "bake-worker/memory_limits.h"

#include <gtest/gtest.h>

#include <fstream>

#include "tests/support/baked_level.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

/// Files as the kernel shows them.
class MemoryGroupTest : public ::testing::Test {
 protected:
  void write(const fs::path& name, const std::string& text) const {
    fs::create_directories((folder_.path() / name).parent_path());
    std::ofstream(folder_.path() / name) << text;
  }
  MemoryGroup group() const { return MemoryGroup(folder_.path() / "proc", folder_.path() / "cgroup"); }

  test::TemporaryFolder folder_;
};

TEST_F(MemoryGroupTest, Version2CountsKillsAndTakesTheLeastLimitAround) {
  write("proc", "0::/farm/worker\n");
  write("cgroup/farm/memory.max", "1000000\n");
  write("cgroup/farm/worker/memory.max", "max\n");
  write("cgroup/farm/worker/memory.events", "low 0\nhigh 0\nmax 12\noom 3\noom_kill 2\noom_group_kill 0\n");
  EXPECT_EQ(group().kills(), 2u);
  EXPECT_EQ(group().limit(), 1000000u);
}

TEST_F(MemoryGroupTest, Version1IsFoundAmongOtherControllers) {
  write("proc", "9:name=systemd:/\n4:cpu,memory:/docker/x\n0::/\n");
  write("cgroup/memory/memory.limit_in_bytes", "9223372036854771712\n");
  write("cgroup/memory/docker/x/memory.limit_in_bytes", "5000\n");
  write("cgroup/memory/docker/x/memory.oom_control", "oom_kill_disable 0\nunder_oom 0\noom_kill 7\n");
  EXPECT_EQ(group().kills(), 7u);
  EXPECT_EQ(group().limit(), 5000u);
}

TEST_F(MemoryGroupTest, InAContainerTheGroupIsWhereItIsMounted) {
  write("proc", "0::/the/hosts/path\n");
  write("cgroup/memory.max", "4096\n");
  write("cgroup/memory.events", "oom_kill 1\n");
  EXPECT_EQ(group().kills(), 1u);
  EXPECT_EQ(group().limit(), 4096u);
}

TEST_F(MemoryGroupTest, NoGroupIsNoLimit) {
  EXPECT_EQ(group().kills(), 0u);
  EXPECT_EQ(group().limit(), std::nullopt);
  EXPECT_GT(usable_memory(), uint64_t{1} << 20);
}

}  // namespace
}  // namespace lightloom
