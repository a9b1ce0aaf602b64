// Blobs that nothing names go; whatever happens at the same time, those that are named or promised stay.
#include "bake-server/upkeep/collect_garbage.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <set>
#include <thread>

#include "bake-server/blobs/blob_store.h"
#include "bake-server/upkeep/upkeep_lock.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

class CollectGarbage : public testing::Test {
 protected:
  void SetUp() override { store_ = value(BlobStore::open(state_.path() / "blobs", Durability::kProcess)); }

  static void make_old(const fs::path& path) {
    const timespec times[2] = {{1'000'000, 0}, {1'000'000, 0}};
    ASSERT_EQ(::utimensat(AT_FDCWD, path.c_str(), times, 0), 0) << path;
  }
  Digest put(const std::string& text, bool old = true) {
    const Digest digest = value(store_->put(bytes_of(text)));
    if (old) make_old(layout_.blob(digest));
    return digest;
  }
  Garbage collect(const GarbageOptions& options = {}) {
    return value(collect_garbage(state_.path(), named(), options));
  }
  References named() {
    return [this](const VisitDigest& visit) {
      for (const Digest& d : named_) visit(d);
      return absl::OkStatus();
    };
  }

  TemporaryFolder state_;
  BlobLayout layout_{state_.path() / "blobs"};
  std::unique_ptr<BlobStore> store_;
  std::set<Digest> named_;
};

TEST_F(CollectGarbage, OldBlobsThatNothingNamesGo) {
  const Digest lost = put("lost"), kept = put("kept"), young = put("young", false);
  named_ = {kept, sha256("never uploaded")};
  const Garbage freed = collect();
  EXPECT_FALSE(store_->has(lost));
  EXPECT_TRUE(store_->has(kept));
  EXPECT_TRUE(store_->has(young));
  EXPECT_EQ(freed.blobs, 1u);
  EXPECT_EQ(freed.bytes, 4u);
  EXPECT_EQ(freed.kept, 2u);
  EXPECT_EQ(freed.kept_bytes, 9u);
  EXPECT_TRUE(fs::is_empty(layout_.trash()));
  EXPECT_EQ(garbage_text(freed, false), "freed 4 B: 1 blob and 0 cut uploads; 2 blobs stay (9 B)");
}

TEST_F(CollectGarbage, ADryRunOnlySays) {
  const Digest lost = put("lost");
  const Garbage freed = collect({.dry_run = true});
  EXPECT_EQ(freed.blobs, 1u);
  EXPECT_EQ(*store_->size(lost), 4u);
  EXPECT_THAT(garbage_text(freed, true), testing::StartsWith("would free 4 B: 1 blob "));
}

TEST_F(CollectGarbage, TheGracePeriodIsTheOptions) {
  const Digest lost = put("lost", false);
  EXPECT_EQ(collect().blobs, 0u);
  const timespec half_an_hour_ago[2] = {{::time(nullptr) - 1800, 0}, {::time(nullptr) - 1800, 0}};
  ASSERT_EQ(::utimensat(AT_FDCWD, layout_.blob(lost).c_str(), half_an_hour_ago, 0), 0);
  EXPECT_EQ(collect().blobs, 0u);
  EXPECT_EQ(collect({.grace_seconds = 900}).blobs, 1u);
}

TEST_F(CollectGarbage, WhoIsToldThatABlobIsThereFindsItLater) {
  const Digest asked = put("asked"), uploaded = put("uploaded"), put_again = put("put again"), sent = put("sent");
  EXPECT_TRUE(store_->has(asked));
  EXPECT_EQ(store_->uploaded(uploaded), 8u);
  value(store_->put(bytes_of("put again")));
  EXPECT_TRUE(store_->append(sent, 4, 0, bytes_of("sent")).ok());
  EXPECT_EQ(collect().blobs, 0u);
  for (const Digest& d : {asked, uploaded, put_again, sent}) EXPECT_TRUE(store_->has(d));
}

TEST_F(CollectGarbage, ABlobThatIsAskedForWhileNamesAreReadStays) {
  const Digest asked = put("asked"), other = put("other");
  const References late = [&](const VisitDigest&) {
    EXPECT_TRUE(store_->has(asked));  // a submission that comes on record too late to be seen
    return absl::OkStatus();
  };
  value(collect_garbage(state_.path(), late, {}));
  EXPECT_TRUE(store_->has(asked));
  EXPECT_FALSE(store_->has(other));
}

TEST_F(CollectGarbage, UploadsThatWereCutGo) {
  const Digest young = sha256("young upload"), old = sha256("old upload");
  ASSERT_TRUE(store_->append(young, 12, 0, bytes_of("young")).ok());
  ASSERT_TRUE(store_->append(old, 10, 0, bytes_of("old")).ok());
  make_old(layout_.part(old));
  const Garbage freed = collect();
  EXPECT_EQ(freed.uploads, 1u);
  EXPECT_EQ(freed.bytes, 3u);
  EXPECT_EQ(store_->uploaded(young), 5u);
  EXPECT_EQ(store_->uploaded(old), 0u);
  EXPECT_TRUE(absl::IsAborted(store_->append(old, 10, 3, bytes_of(" upload")))) << "go on where it is";
  EXPECT_TRUE(store_->append(old, 10, 0, bytes_of("old upload")).ok());
  EXPECT_TRUE(store_->append(young, 12, 5, bytes_of(" upload")).ok());
}

TEST_F(CollectGarbage, ABlobMadeOfAnOldUploadIsYoung) {
  const Digest digest = sha256("upload");
  ASSERT_TRUE(store_->append(digest, 7, 0, bytes_of("upload")).ok());  // of 6 bytes: the client erred, or died
  make_old(layout_.part(digest));
  ASSERT_TRUE(store_->append(digest, 6, 6, {}).ok());
  EXPECT_EQ(collect().blobs, 0u);
}

TEST_F(CollectGarbage, WhatACutCollectionLeftIsFoundAndPutBack) {
  const Digest asked = put("asked"), read = put("read"), measured = put("measured"), left = put("left"),
               both = put("both");
  for (const Digest& d : {asked, read, measured, left, both}) fs::rename(layout_.blob(d), layout_.discarded(d));
  put("both");  // sent again meanwhile
  EXPECT_TRUE(store_->has(asked));
  EXPECT_EQ(*store_->read(read, 0, 100), bytes_of("read"));
  EXPECT_EQ(*store_->size(measured), 8u);
  named_ = {read, measured, left, both};
  EXPECT_EQ(collect().kept, 5u);
  for (const Digest& d : {asked, read, measured, left, both}) EXPECT_TRUE(store_->has(d));
  EXPECT_TRUE(fs::is_empty(layout_.trash()));
}

TEST_F(CollectGarbage, OnlyBlobsAreTouched) {
  const fs::path odd = layout_.folder() / "ab" / "notes.txt", elsewhere = layout_.folder() / "notes.txt";
  fs::create_directories(odd.parent_path());
  for (const fs::path& path : {odd, elsewhere}) {
    std::ofstream(path) << "x";
    make_old(path);
  }
  EXPECT_EQ(collect().blobs, 0u);
  EXPECT_TRUE(fs::exists(odd));
  EXPECT_TRUE(fs::exists(elsewhere));
}

TEST_F(CollectGarbage, OneAtATime) {
  const auto lock = UpkeepLock::take(state_.path());
  ASSERT_TRUE(lock.ok());
  const absl::Status status = collect_garbage(state_.path(), named(), {}).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kUnavailable);
  EXPECT_THAT(std::string(status.message()), HasSubstr(state_.path().string()));
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("\n")));
}

TEST_F(CollectGarbage, ItStopsWhenItIsTold) {
  const Digest lost = put("lost");
  CancelFlag cancel;
  const References slow = [&](const VisitDigest& visit) {
    cancel.cancel();
    EXPECT_FALSE(visit(lost));
    return absl::OkStatus();
  };
  EXPECT_TRUE(absl::IsCancelled(collect_garbage(state_.path(), slow, {.cancel = &cancel}).status()));
  EXPECT_TRUE(store_->has(lost));
}

TEST_F(CollectGarbage, NamesThatCannotBeReadRemoveNothing) {
  const Digest lost = put("lost");
  const auto broken = [](const VisitDigest&) { return absl::DataLossError("damaged"); };
  EXPECT_EQ(collect_garbage(state_.path(), broken, {}).status().code(), absl::StatusCode::kDataLoss);
  EXPECT_TRUE(store_->has(lost));
}

/// The promise itself, against another process that collects as fast as it can: what somebody was told is there, is there.
TEST_F(CollectGarbage, NoPromiseIsBrokenByAnotherProcess) {
  constexpr int kBlobs = 48, kRounds = 60;
  const pid_t collector = ::fork();
  if (collector == 0) {
    ::prctl(PR_SET_PDEATHSIG, SIGKILL);
    const References none = [](const VisitDigest&) { return absl::OkStatus(); };
    for (;;) (void)collect_garbage(state_.path(), none, {});
  }
  size_t promised = 0, missing = 0;
  for (int round = 0; round < kRounds || missing == 0 || promised == 0; ++round) {
    std::vector<Digest> all;
    for (int i = 0; i < kBlobs; ++i) {
      all.push_back(value(store_->put(bytes_of(absl::StrCat("blob ", i)))));
      const timespec old[2] = {{1'000'000, 0}, {1'000'000, 0}};
      ::utimensat(AT_FDCWD, layout_.blob(all.back()).c_str(), old, 0);  // and so it may be gone at any moment
    }
    const auto ask = [&](std::vector<Digest>* told) {
      for (const Digest& d : all) {
        if (store_->has(d)) told->push_back(d);
      }
    };
    std::vector<Digest> told, told_another;
    std::thread another([&] { ask(&told_another); });
    ask(&told);
    another.join();
    promised += told.size() + told_another.size();
    missing += 2 * all.size() - told.size() - told_another.size();
    for (const auto* promises : {&told, &told_another}) {
      for (const Digest& d : *promises) EXPECT_TRUE(store_->read(d, 0, 100).ok()) << d.hex();
    }
  }
  ::kill(collector, SIGKILL);
  int status = 0;
  EXPECT_EQ(::waitpid(collector, &status, 0), collector);
  EXPECT_EQ(WTERMSIG(status), SIGKILL) << "it collected until the end";
}

}  // namespace
}  // namespace lightloom::test
