#include "core/base/file.h"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <string>

namespace lightloom {
namespace {

namespace fs = std::filesystem;

class FileTest : public ::testing::Test {
 protected:
  void SetUp() override {
    std::string name = ::testing::TempDir() + "lightloom-file-XXXXXX";
    ASSERT_NE(::mkdtemp(name.data()), nullptr);
    folder_ = name;
  }
  void TearDown() override {
    ::chmod(folder_.c_str(), 0755);
    fs::remove_all(folder_);
  }
  static std::string text_of(const fs::path& path) {
    const auto bytes = read_file(path);
    return bytes.ok() ? std::string(bytes->begin(), bytes->end()) : std::string(bytes.status().message());
  }
  size_t files() const {
    size_t n = 0;
    for ([[maybe_unused]] const auto& entry : fs::directory_iterator(folder_)) ++n;
    return n;
  }

  fs::path folder_;
};

TEST_F(FileTest, WritesAndReadsBack) {
  const fs::path path = folder_ / "a";
  ASSERT_TRUE(write_file_atomic(path, std::string_view("one")).ok());
  EXPECT_EQ(text_of(path), "one");
  ASSERT_TRUE(write_file_atomic(path, std::string_view("")).ok());
  EXPECT_EQ(text_of(path), "");
  EXPECT_EQ(files(), 1u) << "no temporary is left";
}

TEST_F(FileTest, CreatesMissingParents) {
  const fs::path path = folder_ / "b" / "c" / "d";
  ASSERT_TRUE(write_file_atomic(path, std::string_view("deep")).ok());
  EXPECT_EQ(text_of(path), "deep");
}

TEST_F(FileTest, AParentThatIsAFileIsAnError) {
  ASSERT_TRUE(write_file_atomic(folder_ / "a", std::string_view("one")).ok());
  const absl::Status status = write_file_atomic(folder_ / "a" / "b", std::string_view("two"));
  EXPECT_FALSE(status.ok());
  EXPECT_NE(status.message().find((folder_ / "a").string()), std::string::npos) << status;
  EXPECT_EQ(text_of(folder_ / "a"), "one");
}

TEST_F(FileTest, OldContentSurvivesAReadOnlyFolder) {
  const fs::path path = folder_ / "a";
  ASSERT_TRUE(write_file_atomic(path, std::string_view("old")).ok());
  ASSERT_EQ(::chmod(folder_.c_str(), 0555), 0);
  // Permissions do not bind root: act as nobody.
  const bool root = ::geteuid() == 0;
  if (root) {
    ASSERT_EQ(::seteuid(65534), 0);
  }
  const absl::Status status = write_file_atomic(path, std::string_view("new"));
  if (root) {
    ASSERT_EQ(::seteuid(0), 0);
  }
  EXPECT_EQ(status.code(), absl::StatusCode::kPermissionDenied) << status;
  EXPECT_EQ(text_of(path), "old");
  EXPECT_EQ(files(), 1u);
}

TEST_F(FileTest, OldContentSurvivesAWriteThatStopsHalfway) {
  const fs::path path = folder_ / "a";
  ASSERT_TRUE(write_file_atomic(path, std::string_view("old")).ok());
  // As on a full disk: write() fails after 4096 bytes.
  struct rlimit before {};
  ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto handler = std::signal(SIGXFSZ, SIG_IGN);
  struct rlimit small = before;
  small.rlim_cur = 4096;
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
  const absl::Status status = write_file_atomic(path, std::string(10000, 'x'));
  ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
  std::signal(SIGXFSZ, handler);
  EXPECT_FALSE(status.ok());
  EXPECT_EQ(text_of(path), "old");
  EXPECT_EQ(files(), 1u) << "the half-written temporary is removed";
}

TEST_F(FileTest, AFailedRenameLeavesNothingBehind) {
  fs::create_directory(folder_ / "target");
  ASSERT_FALSE(write_file_atomic(folder_ / "target", std::string_view("new")).ok());
  EXPECT_TRUE(fs::is_directory(folder_ / "target"));
  EXPECT_EQ(files(), 1u);
}

TEST_F(FileTest, OnlyRegularFilesAreReplaced) {
  ASSERT_TRUE(write_file_atomic(folder_ / "file", std::string_view("old")).ok());
  fs::create_symlink("file", folder_ / "link");
  fs::create_symlink("nothing", folder_ / "dangling");
  fs::create_directory(folder_ / "folder");
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0644), 0);
  for (const char* name : {"link", "dangling", "folder", "pipe"}) {
    const fs::path path = folder_ / name;
    EXPECT_EQ(write_file_atomic(path, std::string_view("new")).code(), absl::StatusCode::kFailedPrecondition) << name;
    ASSERT_TRUE(write_file_atomic(folder_ / "temporary", std::string_view("new")).ok());
    EXPECT_EQ(commit_file(folder_ / "temporary", path).code(), absl::StatusCode::kFailedPrecondition) << name;
    EXPECT_EQ(check_writable(path).code(), absl::StatusCode::kFailedPrecondition) << name;
  }
  EXPECT_EQ(check_replaceable("/dev/null").code(), absl::StatusCode::kFailedPrecondition);
  EXPECT_EQ(text_of(folder_ / "file"), "old");
  EXPECT_TRUE(fs::is_symlink(folder_ / "link"));
  EXPECT_TRUE(fs::is_fifo(folder_ / "pipe"));
  EXPECT_EQ(files(), 5u) << "no temporary is left";
}

TEST_F(FileTest, APipeIsNotWaitedFor) {
  ASSERT_EQ(::mkfifo((folder_ / "pipe").c_str(), 0644), 0);
  EXPECT_EQ(read_file(folder_ / "pipe").status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(FileTest, CheckWritableLooksAtTheNearestFolderAndLeavesNothing) {
  EXPECT_TRUE(check_writable(folder_ / "a" / "b" / "c").ok());
  EXPECT_EQ(files(), 0u);
  ASSERT_TRUE(write_file_atomic(folder_ / "a", std::string_view("one")).ok());
  EXPECT_TRUE(check_writable(folder_ / "a").ok());
  EXPECT_FALSE(check_writable(folder_ / "a" / "b" / "c").ok());
  EXPECT_FALSE(check_writable(folder_ / std::string(300, 'x')).ok());
  EXPECT_FALSE(check_writable("/proc/nothing/here").ok());
  EXPECT_EQ(files(), 1u);
}

TEST_F(FileTest, ReadErrorsNameThePath) {
  const auto missing = read_file(folder_ / "nothing");
  EXPECT_EQ(missing.status().code(), absl::StatusCode::kNotFound);
  EXPECT_NE(missing.status().message().find((folder_ / "nothing").string()), std::string::npos);
  EXPECT_EQ(read_file(folder_).status().code(), absl::StatusCode::kInvalidArgument);
}

TEST_F(FileTest, TemporariesDiffer) {
  EXPECT_NE(temporary_beside(folder_ / "a"), temporary_beside(folder_ / "a"));
  EXPECT_EQ(temporary_beside(folder_ / "a").parent_path(), folder_);
}

TEST_F(FileTest, CommitOfAMissingTemporaryFails) {
  EXPECT_EQ(commit_file(folder_ / "no", folder_ / "a").code(), absl::StatusCode::kNotFound);
  EXPECT_EQ(files(), 0u);
}

}  // namespace
}  // namespace lightloom
