// Power losses: the server keeps what it said, wherever they come.
#include <gtest/gtest.h>

#include <map>

#include "tests/faults/power_loss_farm.h"

namespace lightloom::test {
namespace {

TEST_F(PowerLossFarm, Anywhere) { lose_power_at(24); }

std::string text_of(const std::filesystem::path& path) {
  const std::vector<uint8_t> bytes = value_or_die(read_file(path));
  return {bytes.begin(), bytes.end()};
}

/// The fault itself: what it takes, and what it leaves.
class PowerLoss : public testing::Test {
 protected:
  using Steps = std::vector<std::string>;

  /// What is left when the power goes after the steps: contents by path, folders with a slash.
  std::map<std::string, std::string> after(const Steps& steps) {
    const TemporaryFolder folder;
    const std::filesystem::path disk = folder.path() / "disk";
    const auto run = [&](const Steps& all, const std::string& at) {
      std::filesystem::remove_all(disk);
      std::filesystem::create_directory(disk);
      Steps command = {"/usr/bin/env",
                       "--chdir=" + disk.string(),
                       "LD_PRELOAD=" LIGHTLOOM_FAULT_AT_A_FILE,
                       "FILE_FAULT=power",
                       "FAULT_AT_FILE_CHANGE=" + at,
                       "POWER_LOSS_FOLDER=" + disk.string(),
                       "COUNTED_FILE_CHANGES=" + (folder.path() / "counted").string(),
                       FILE_STEPS};
      command.insert(command.end(), all.begin(), all.end());
      Process process(command);
      const int code = process.wait();
      EXPECT_EQ(process.output(), "");
      return code;
    };
    EXPECT_EQ(run(steps, "0"), 0);
    Steps one_more = steps;
    one_more.insert(one_more.end(), {"mkdir", "never"});
    const int changes = std::stoi(text_of(folder.path() / "counted"));
    EXPECT_EQ(run(one_more, std::to_string(changes + 1)), -SIGKILL);
    EXPECT_EQ(std::distance(std::filesystem::directory_iterator(folder.path()), {}), 2);  // disk and counted

    std::map<std::string, std::string> left;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(disk)) {
      const std::string path = std::filesystem::relative(entry.path(), disk).string();
      left[entry.is_directory() ? path + "/" : path] = entry.is_directory() ? "" : text_of(entry.path());
    }
    return left;
  }
  /// After the file `a` is there for good, with the text "old".
  std::map<std::string, std::string> after_old(const Steps& steps) {
    Steps all = {"write", "a", "old", "sync", "a", "sync", "."};
    all.insert(all.end(), steps.begin(), steps.end());
    return after(all);
  }
  using Left = std::map<std::string, std::string>;
};

TEST_F(PowerLoss, TakesFilesThatAreNotSynced) {
  EXPECT_EQ(after({"write", "a", "text"}), Left{});
  EXPECT_EQ(after({"write", "a", "text", "sync", "a"}), Left{});
  EXPECT_EQ(after({"write", "a", "text", "sync", "."}), (Left{{"a", ""}}));
  EXPECT_EQ(after({"write", "a", "text", "sync", "a", "sync", "."}), (Left{{"a", "text"}}));
}

TEST_F(PowerLoss, TakesWritesToFilesThatAreThere) {
  EXPECT_EQ(after_old({"write", "a", "newer"}), (Left{{"a", "old"}}));
  EXPECT_EQ(after_old({"write", "a", "n", "write", "a", "ne", "write", "a", "newest"}), (Left{{"a", "old"}}));
  EXPECT_EQ(after_old({"write", "a", "newer", "sync", "a"}), (Left{{"a", "newer"}}));
  EXPECT_EQ(after_old({"write", "a", "newer", "sync", "a", "write", "a", "xyz"}), (Left{{"a", "newer"}}));
}

TEST_F(PowerLoss, TakesNames) {
  EXPECT_EQ(after_old({"rename", "a", "b"}), (Left{{"a", "old"}}));
  EXPECT_EQ(after_old({"rename", "a", "b", "sync", "b"}), (Left{{"a", "old"}}));
  EXPECT_EQ(after_old({"rename", "a", "b", "sync", "."}), (Left{{"b", "old"}}));
  EXPECT_EQ(after_old({"unlink", "a"}), (Left{{"a", "old"}}));
  EXPECT_EQ(after_old({"unlink", "a", "sync", "."}), Left{});
  EXPECT_EQ(after_old({"unlink", "a", "write", "a", "new", "sync", "a"}), (Left{{"a", "old"}}));
  EXPECT_EQ(after_old({"write", "b", "new", "sync", "b", "rename", "b", "a"}), (Left{{"a", "old"}}));
  EXPECT_EQ(after_old({"write", "b", "new", "sync", "b", "rename", "b", "a", "sync", "."}), (Left{{"a", "new"}}));
  EXPECT_EQ(after_old({"write", "b", "new", "rename", "b", "a", "sync", "."}), (Left{{"a", ""}}));
}

TEST_F(PowerLoss, TakesFolders) {
  const Steps filled = {"mkdir", "d", "write", "d/a", "text", "sync", "d/a", "sync", "d"};
  EXPECT_EQ(after(filled), Left{});
  Steps synced = filled;
  synced.insert(synced.end(), {"sync", "."});
  EXPECT_EQ(after(synced), (Left{{"d/", ""}, {"d/a", "text"}}));
  EXPECT_EQ(after({"mkdir", "d", "sync", ".", "write", "d/a", "text", "sync", "d/a", "sync", "."}), (Left{{"d/", ""}}));
}

}  // namespace
}  // namespace lightloom::test
