// What keeps a state folder in bounds: room on the disk, quotas, old jobs, backups. On real folders, with a clock and a disk
// that the test sets.
#include "bake-server/upkeep/upkeep.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <spdlog/sinks/ostream_sink.h>
#include <spdlog/spdlog.h>
#include <sys/stat.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <thread>

#include "bake-server/blobs/blob_store.h"
#include "bake-server/upkeep/backup.h"
#include "bake-server/upkeep/free_space.h"
#include "bake-server/upkeep/quota.h"
#include "bake-server/upkeep/upkeep_lock.h"
#include "tests/support/small_disk.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::IsEmpty;
using testing::Not;

constexpr int64_t kDay = 86'400'000;

/// One line that holds `what`.
void expect_line(const absl::Status& status, absl::StatusCode code, const std::string& what) {
  EXPECT_EQ(status.code(), code) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(what));
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("\n")));
}

/// A state folder with its store and its blobs.
class StateFolder : public testing::Test {
 protected:
  void SetUp() override {
    store_ = value(open_sqlite_store(state(), Durability::kProcess));
    blobs_ = value(BlobStore::open(state() / "blobs", Durability::kProcess));
  }
  fs::path state() const { return folder_.path() / "state"; }

  Digest put(const std::string& text) {
    const Digest digest = value(blobs_->put(bytes_of(text)));
    const timespec old[2] = {{1'000'000, 0}, {1'000'000, 0}};
    EXPECT_EQ(::utimensat(AT_FDCWD, BlobLayout(state() / "blobs").blob(digest).c_str(), old, 0), 0);
    return digest;
  }
  NewJob job_of(const std::string& request, const std::string& input) {
    NewJob job = new_job(request, {cell(0, 0)});
    job.payload = request;
    job.inputs = {put(input)};
    return job;
  }
  /// A job that is done at `at_ms`.
  JobId done(const std::string& request, int64_t at_ms, const std::string& input, const std::string& output) {
    const JobId id = value(store_->submit(job_of(request, input), at_ms)).id;
    const TaskId task = value(store_->view(1)).at(0).ready.at(0).task;
    EXPECT_TRUE(value(store_->lease({task, "w", request, at_ms + 100, 1}, at_ms)));
    EXPECT_EQ(value(store_->complete(request, {put(output)}, {}, at_ms)), Completion::kAccepted);
    return id;
  }

  TemporaryFolder folder_;
  std::unique_ptr<Store> store_;
  std::unique_ptr<BlobStore> blobs_;
};

TEST(FreeSpace, IsMeasuredWithEveryQuestionAndLoggedWhenItChanges) {
  const auto before = spdlog::default_logger();
  std::ostringstream log;
  spdlog::set_default_logger(
      std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::ostream_sink_mt>(log)));
  absl::StatusOr<uint64_t> free = 1000;
  FreeSpace space("/state", 1000, [&](const fs::path&) { return free; });
  EXPECT_TRUE(space.check().ok());
  free = 999;
  for (int i = 0; i < 3; ++i)
    expect_line(space.check(), absl::StatusCode::kResourceExhausted, "999 B left, and keeps 1000 B");
  free = 1000;
  for (int i = 0; i < 3; ++i) EXPECT_TRUE(space.check().ok());
  free = absl::UnavailableError("cannot");
  EXPECT_TRUE(space.check().ok());
  spdlog::set_default_logger(before);
  const std::string lines = log.str();
  EXPECT_EQ(std::count(lines.begin(), lines.end(), '\n'), 2) << lines;
  EXPECT_THAT(lines, HasSubstr("--min-free"));
  EXPECT_THAT(lines, HasSubstr("room at /state again"));
}

TEST(FreeSpace, OfARealDisk) {
  const TemporaryFolder folder;
  EXPECT_GT(value(free_bytes(folder.path())), 0u);
  expect_line(free_bytes(folder.path() / "not there").status(), absl::StatusCode::kUnavailable, "not there");
}

TEST(FreeSpace, UploadsAreRefusedWhileThereIsTooLittle) {
  const TemporaryFolder folder;
  uint64_t free = 2000;
  FreeSpace space(folder.path(), 1000, [&](const fs::path&) { return free; });
  const auto blobs =
      value(BlobStore::open(folder.path() / "blobs", Durability::kProcess, [&] { return space.check(); }));
  const Digest digest = sha256("0123456789"), there = value(blobs->put(bytes_of("there")));
  EXPECT_TRUE(blobs->append(digest, 10, 0, bytes_of("01234")).ok());
  free = 10;
  expect_line(blobs->append(digest, 10, 5, bytes_of("56789")), absl::StatusCode::kResourceExhausted, "free space");
  EXPECT_EQ(blobs->uploaded(digest), 0u) << "what it took is free again";
  EXPECT_TRUE(blobs->append(there, 5, 0, bytes_of("there")).ok()) << "what is there needs no room";
  free = 2000;
  EXPECT_TRUE(blobs->append(digest, 10, 0, bytes_of("0123456789")).ok());
}

TEST(FreeSpace, OfASmallDiskRunsOutAndComesBack) {
  const TemporaryFolder folder;
  const SmallDisk disk(folder.path() / "disk", "4m");
  if (!disk.mounted()) GTEST_SKIP() << "this user may not mount another file system";
  FreeSpace space(folder.path() / "disk", 1 << 20);
  const auto blobs =
      value(BlobStore::open(folder.path() / "disk" / "blobs", Durability::kProcess, [&] { return space.check(); }));
  const std::vector<uint8_t> piece(size_t{512} << 10, 1);
  const Digest endless = sha256("endless");
  uint64_t at = 0;
  absl::Status status;
  for (; status.ok() && at < (8 << 20); at += piece.size()) status = blobs->append(endless, 16 << 20, at, piece);
  expect_line(status, absl::StatusCode::kResourceExhausted, (folder.path() / "disk").string());
  EXPECT_TRUE(blobs->append(endless, 16 << 20, 0, piece).ok()) << "what it took is free again";
  std::ofstream(folder.path() / "disk" / "something else") << std::string(size_t{3} << 20, 'x');
  EXPECT_TRUE(absl::IsResourceExhausted(blobs->append(endless, 16 << 20, piece.size(), piece)));
  fs::remove(folder.path() / "disk" / "something else");
  EXPECT_TRUE(blobs->append(endless, 16 << 20, 0, piece).ok());
}

using Quota = StateFolder;

TEST_F(Quota, CountsDistinctBlobsOfTheClientsJobs) {
  done("a", 1, "level of ten", "result");  // 12 + 6 bytes
  done("b", 1, "level of ten", "result");  // the same
  const NewJob again = job_of("c", "level of ten"), more = job_of("d", "12345");
  EXPECT_TRUE(check_quota(18, again, store_.get(), *blobs_).ok());
  EXPECT_TRUE(check_quota(23, more, store_.get(), *blobs_).ok());
  EXPECT_TRUE(check_quota(0, more, store_.get(), *blobs_).ok()) << "no limit";
  const absl::Status status = check_quota(22, more, store_.get(), *blobs_);
  expect_line(status, absl::StatusCode::kResourceExhausted, "client 'c' keeps 18 B here and this job adds 5 B");
  EXPECT_THAT(std::string(status.message()), HasSubstr("its quota is 22 B"));
  NewJob of_another = more;
  of_another.client = "other";
  EXPECT_TRUE(check_quota(5, of_another, store_.get(), *blobs_).ok());
}

class UpkeepTest : public StateFolder {
 protected:
  std::unique_ptr<Upkeep> upkeep(UpkeepOptions options) {
    return std::make_unique<Upkeep>(
        state(), store_.get(), [this] { return now_ms_.load(); }, options);
  }
  std::atomic<int64_t> now_ms_{100 * kDay};
};

TEST_F(UpkeepTest, OldJobsAreForgottenAndTheirBlobsGo) {
  done("old", 69 * kDay, "shared level", "old result");
  const JobId young = done("young", 71 * kDay, "shared level", "young result");
  const auto upkeep = UpkeepTest::upkeep({});
  EXPECT_EQ(value(upkeep->run()), 1u);
  EXPECT_EQ(value(store_->jobs(0, 10)).at(0).id, young);
  EXPECT_FALSE(blobs_->has(sha256("old result")));
  EXPECT_TRUE(blobs_->has(sha256("young result")));
  EXPECT_TRUE(blobs_->has(sha256("shared level")));
  EXPECT_EQ(value(upkeep->run()), 0u);
}

TEST_F(UpkeepTest, JobsMayBeKeptForEver) {
  done("old", 1, "level", "result");
  put("left over");
  EXPECT_EQ(value(upkeep({.retain_seconds = 0})->run()), 0u);
  EXPECT_EQ(value(store_->jobs(0, 10)).size(), 1u);
  EXPECT_TRUE(blobs_->has(sha256("result")));
  EXPECT_FALSE(blobs_->has(sha256("left over")));
}

TEST_F(UpkeepTest, ItRunsByItselfWhenTheTimeHasCome) {
  done("old", 1, "level", "result");
  const auto running = upkeep({.every_ms = 5});
  while (blobs_->size(sha256("result")).ok()) {
    now_ms_ += 5;
    std::this_thread::yield();
  }
  EXPECT_THAT(value(store_->jobs(0, 10)), IsEmpty());
}

TEST_F(UpkeepTest, ItEndsInTheMiddle) {
  std::vector<NewTask> tasks;
  for (int i = 0; i < 5000; ++i) tasks.push_back(cell(0, i));
  const JobId job = value(store_->submit(new_job("large", tasks), 1)).id;
  value(store_->cancel(job, 2));
  {
    const auto running = upkeep({.every_ms = 1, .rows = 1});  // at least a minute's work
    const auto rows = [&] { return value(store_->events(job, 0, 10)).size(); };
    const size_t all = rows();
    while (rows() == all) ++now_ms_;
  }
  EXPECT_TRUE(store_->job(job).ok());
}

TEST_F(UpkeepTest, ABackupIsNotDisturbed) {
  put("left over");
  const auto lock = UpkeepLock::take(state());
  expect_line(upkeep({})->run().status(), absl::StatusCode::kUnavailable, "backup");
  EXPECT_TRUE(blobs_->has(sha256("left over")));
}

class BackupTest : public StateFolder {
 protected:
  void expect_same(const fs::path& copy) {
    const auto copied = value(open_sqlite_store(copy));
    const auto blobs = value(BlobStore::open(copy / "blobs"));
    const auto jobs = value(store_->jobs(0, 10)), jobs_there = value(copied->jobs(0, 10));
    ASSERT_EQ(jobs_there.size(), jobs.size());
    for (size_t i = 0; i < jobs.size(); ++i) {
      EXPECT_EQ(jobs_there[i].id, jobs[i].id);
      EXPECT_EQ(jobs_there[i].state, jobs[i].state);
      EXPECT_EQ(jobs_there[i].outputs, jobs[i].outputs);
      EXPECT_EQ(value(copied->events(jobs[i].id, 0, 100)).size(), value(store_->events(jobs[i].id, 0, 100)).size());
      for (const Digest& d : jobs[i].inputs) EXPECT_EQ(value(blobs->read(d, 0, 100)), value(blobs_->read(d, 0, 100)));
      for (const Digest& d : jobs[i].outputs) EXPECT_EQ(value(blobs->read(d, 0, 100)), value(blobs_->read(d, 0, 100)));
    }
    // Numbers go on where they were.
    EXPECT_EQ(value(copied->submit(new_job("next", {cell(0, 0)}), 9)).id, static_cast<JobId>(jobs.size()) + 1);
  }
  /// Nothing but what was there before.
  void expect_no_draft(const fs::path& folder, size_t things) {
    EXPECT_EQ(static_cast<size_t>(std::distance(fs::directory_iterator(folder), fs::directory_iterator())), things);
  }
};

TEST_F(BackupTest, HoldsAllJobsAndTheBlobsThatTheyName) {
  done("a", 10, "level", "result");
  value(store_->submit(job_of("b", "another level"), 20));
  put("left over");
  const Backup backup = value(back_up(state(), folder_.path() / "copy/"));
  EXPECT_EQ(backup.blobs, 3u);
  EXPECT_EQ(backup.bytes, 5u + 6u + 13u);
  EXPECT_EQ(backup.linked, 3u);
  EXPECT_EQ(backup_text(backup), "3 blobs, 24 B, 3 of them linked");
  expect_no_draft(folder_.path(), 2);
  expect_same(folder_.path() / "copy");
}

TEST_F(BackupTest, OnAnotherDiskBlobsAreCopied) {
  const SmallDisk disk(folder_.path() / "disk", "8m");
  if (!disk.mounted()) GTEST_SKIP() << "this user may not mount another file system";
  done("a", 10, "level", "result");
  const Backup backup = value(back_up(state(), folder_.path() / "disk" / "copy"));
  EXPECT_EQ(backup.blobs, 2u);
  EXPECT_EQ(backup.linked, 0u);
  expect_same(folder_.path() / "disk" / "copy");
}

TEST_F(BackupTest, ADiskThatIsTooSmallHoldsNoBackup) {
  const SmallDisk disk(folder_.path() / "disk", "512k");
  if (!disk.mounted()) GTEST_SKIP() << "this user may not mount another file system";
  done("a", 10, std::string(1 << 20, 'x'), "result");
  EXPECT_THAT(std::string(back_up(state(), folder_.path() / "disk" / "copy").status().message()), HasSubstr("space"));
  expect_no_draft(folder_.path() / "disk", 0);
}

TEST_F(BackupTest, AnEmptyFolderWillDoAndNothingElse) {
  done("a", 10, "level", "result");
  const fs::path full = folder_.path() / "full", empty = folder_.path() / "empty", file = folder_.path() / "file";
  fs::create_directory(empty);
  fs::create_directory(full);
  std::ofstream(full / "mine") << "x";
  std::ofstream(file) << "x";
  for (const fs::path& target : {full, file}) {
    expect_line(back_up(state(), target).status(), absl::StatusCode::kFailedPrecondition, target.string());
  }
  EXPECT_EQ(value(back_up(state(), empty)).blobs, 2u);
  expect_same(empty);
  expect_no_draft(folder_.path(), 4);
}

TEST_F(BackupTest, WhatIsMissingIsToldAndAllElseIsThere) {
  done("a", 10, "level", "result");
  done("b", 20, "another level", "another result");
  const BlobLayout layout(state() / "blobs");
  fs::remove(layout.blob(sha256("level")));
  Backup backup = value(back_up(state(), folder_.path() / "copy"));
  EXPECT_EQ(backup.blobs, 3u);
  EXPECT_EQ(backup.missing, 1u);
  EXPECT_EQ(backup.first_missing, sha256("level"));
  expect_line(
      check_whole(backup, "copy"), absl::StatusCode::kDataLoss,
      "the backup copy has all else, but a blob that a job names is missing or damaged: " + sha256("level").hex());
  const auto copy = value(BlobStore::open(folder_.path() / "copy" / "blobs"));
  for (const char* there : {"result", "another level", "another result"}) EXPECT_TRUE(copy->has(sha256(there)));
  fs::remove(layout.blob(sha256("result")));
  backup = value(back_up(state(), folder_.path() / "second"));
  EXPECT_EQ(backup.missing, 2u);
  expect_line(check_whole(backup, "second"), absl::StatusCode::kDataLoss, "2 blobs");
}

TEST_F(BackupTest, ADamagedBlobIsNotCopied) {
  const SmallDisk disk(folder_.path() / "disk", "8m");
  if (!disk.mounted()) GTEST_SKIP() << "this user may not mount another file system";
  done("a", 10, "level", "result");
  std::ofstream(BlobLayout(state() / "blobs").blob(sha256("result"))) << "lesurt";
  const Backup backup = value(back_up(state(), folder_.path() / "disk" / "copy"));
  EXPECT_EQ(backup.blobs, 1u);
  EXPECT_EQ(backup.missing, 1u);
  EXPECT_EQ(backup.first_missing, sha256("result"));
}

TEST_F(BackupTest, NoneLiesInWhatItCopies) {
  done("a", 10, "level", "result");
  fs::create_directory_symlink(state(), folder_.path() / "link");
  for (const fs::path& to : {state() / "copy", state() / "a" / ".." / "copy", folder_.path() / "link" / "copy/"}) {
    expect_line(back_up(state(), to).status(), absl::StatusCode::kFailedPrecondition, "lies in the state folder");
  }
  EXPECT_FALSE(fs::exists(state() / "copy"));
  EXPECT_TRUE(back_up(state(), folder_.path() / "state-copy").ok()) << "beside it is not in it";
}

TEST_F(BackupTest, WhatIsCutLeavesNothing) {
  done("a", 10, "level", "result");
  CancelFlag cancel;
  cancel.cancel();
  EXPECT_TRUE(absl::IsCancelled(back_up(state(), folder_.path() / "copy", &cancel).status()));
  expect_line(back_up(folder_.path(), folder_.path() / "copy").status(), absl::StatusCode::kFailedPrecondition,
              "no state folder");
  expect_no_draft(folder_.path(), 1);
}

}  // namespace
}  // namespace lightloom::test
