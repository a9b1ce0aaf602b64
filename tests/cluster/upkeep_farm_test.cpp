// What keeps a farm's state folder in bounds, while the farm bakes: the asset has the same bytes all the same.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <atomic>
#include <thread>

#include "bake-server/store/sqlite_upkeep.h"
#include "bake-server/upkeep/backup.h"
#include "tests/cluster/farm_fixture.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using test::FarmTest;
using test::RunningWorker;
using test::value_or_die;
using ::testing::HasSubstr;
using ::testing::Not;

class UpkeepFarm : public FarmTest {
 protected:
  fs::path state() const { return folder_.path() / "state"; }

  void restart(const FarmLimits& limits) {
    stop_server();
    farm_ = value_or_die(Farm::open(state(), {}, Durability::kProcess, limits));
    server_ = value_or_die(Server::start("127.0.0.1:0", test::this_release(), farm_.get()));
  }
  absl::Status submit_status() {
    FarmClient client(address());
    return client.submit(scene_, params_, "cornell", 0, [](uint64_t) {}).status();
  }
  /// Over a connection of its own, as another process.
  Garbage gc(int64_t grace_seconds) {
    const auto database = value_or_die(open_sqlite_reader(state()));
    const References references = [&](const VisitDigest& visit) { return visit_references(*database, visit); };
    return value_or_die(collect_garbage(state(), references, {.grace_seconds = grace_seconds}));
  }
  void make_blobs_old() {
    const timespec old[2] = {{1'000'000, 0}, {1'000'000, 0}};
    for (const auto& file : fs::recursive_directory_iterator(state() / "blobs")) {
      if (file.is_regular_file()) ::utimensat(AT_FDCWD, file.path().c_str(), old, 0);
    }
  }
};

TEST_F(UpkeepFarm, ABackupFromTheMiddleOfAJobGoesOnElsewhere) {
  const RemoteJob job = submit();
  {
    const RunningWorker worker(dial(address()), "worker", 2);
    bool copied = false;
    const RemoteJob end = watch(job.id, [&](const RemoteJob& now) {
      if (copied || now.done < 3 || now.ended()) return;
      copied = true;
      EXPECT_GT(value_or_die(back_up(state(), folder_.path() / "copy")).blobs, 2u);
    });
    EXPECT_EQ(end.state, "done") << end.error;
    EXPECT_TRUE(copied);
  }
  stop_server();
  fs::remove_all(state());
  fs::rename(folder_.path() / "copy", state());
  start_server("127.0.0.1:0");
  FarmClient client(address());
  const RemoteJob there = value_or_die(client.job(job.id));
  EXPECT_EQ(there.state, "running");
  EXPECT_GE(there.done, 3u);
  const RunningWorker worker(dial(address()), "another");
  const RemoteJob end = watch(job.id);
  ASSERT_EQ(end.state, "done") << end.error;
  expect_fetched_as_baked(job.id);
}

TEST_F(UpkeepFarm, GarbageIsCollectedWhileAJobRuns) {
  const Digest left_over = value_or_die(farm_->blobs().put({}));
  make_blobs_old();
  const RemoteJob job = submit();
  const RunningWorker worker(dial(address()), "worker", 2);
  std::atomic<bool> ended{false};
  std::thread collector([&] {
    while (!ended) gc(3600);
  });
  const RemoteJob end = watch(job.id);
  ended = true;
  collector.join();
  ASSERT_EQ(end.state, "done") << end.error;
  EXPECT_FALSE(farm_->blobs().has(left_over));
  // What the job names stays, however old.
  make_blobs_old();
  gc(3600);
  expect_fetched_as_baked(job.id);
}

TEST_F(UpkeepFarm, WhatAForgottenJobLeftIsFreed) {
  const RemoteJob job = submit();
  {
    const RunningWorker worker(dial(address()), "worker", 2);
    ASSERT_EQ(watch(job.id).state, "done");
  }
  make_blobs_old();
  FarmLimits limits;
  limits.upkeep.emplace();
  restart(limits);
  const int64_t later = steady_unix_clock()() + 31 * int64_t{86'400'000};
  const auto reader = value_or_die(Database::open(state() / "store.db", Durability::kProcess));
  EXPECT_EQ(value_or_die(forget_ended(*reader, later, 1'000'000)).jobs, 1u);
  EXPECT_GT(gc(3600).blobs, 5u);
  EXPECT_EQ(gc(3600).kept, 0u);
  FarmClient client(address());
  EXPECT_TRUE(value_or_die(client.jobs()).empty());
  // The same level again is a new job, baked anew.
  const RemoteJob again = submit();
  const RunningWorker worker(dial(address()), "worker", 2);
  const RemoteJob end = watch(again.id);
  ASSERT_EQ(end.state, "done") << end.error;
  EXPECT_EQ(end.reused, 0u);
  expect_fetched_as_baked(again.id);
}

TEST_F(UpkeepFarm, AResultThatIsGoneIsBakedAgain) {
  params_.rays = 16;
  const RemoteJob job = submit();
  // Blobs that are never touched in time: as if the worker had been away for long between upload and report.
  std::atomic<int> lost{0};
  const RunningWorker worker(dial(address()), "worker");
  const RemoteJob end = watch(job.id, [&](const RemoteJob& now) {
    if (lost > 0 || now.done < 2 || now.ended()) return;
    make_blobs_old();
    lost += static_cast<int>(gc(3600).blobs) + 1;
  });
  ASSERT_EQ(end.state, "done") << end.error;
  const auto database = value_or_die(open_sqlite_reader(state()));
  ASSERT_TRUE(visit_references(*database, [&](const Digest& d) {
                EXPECT_TRUE(farm_->blobs().has(d)) << d.hex();
                return true;
              }).ok());
}

TEST_F(UpkeepFarm, ADiskWithoutRoomPausesAllUntilThereIsRoom) {
  std::atomic<int> questions_without_room{1'000'000};
  FarmLimits limits;
  limits.min_free = 1000;
  limits.measure = [&](const fs::path&) -> uint64_t { return questions_without_room-- > 0 ? 1 : 1000; };
  restart(limits);
  const absl::Status refused = submit_status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted) << refused;
  EXPECT_THAT(std::string(refused.message()), HasSubstr("free space"));
  EXPECT_THAT(std::string(refused.message()), Not(HasSubstr("\n")));

  questions_without_room = 0;
  const RemoteJob job = submit();
  bool filled = false;
  {
    const RunningWorker worker(dial(address()), "worker");
    const RemoteJob end = watch(job.id, [&](const RemoteJob& now) {
      if (!filled && now.done >= 2) questions_without_room = 20;  // some by uploads, some by leases
      filled = filled || now.done >= 2;
    });
    ASSERT_EQ(end.state, "done") << end.error;
  }
  EXPECT_TRUE(filled);
  EXPECT_LE(questions_without_room, 0);
  expect_fetched_as_baked(job.id);
  stop_server();  // it measures until then
}

TEST_F(UpkeepFarm, AQuotaRefusesMoreOfOneClient) {
  FarmLimits limits;
  limits.quota = scene_.size();
  restart(limits);
  EXPECT_TRUE(submit_status().ok());
  EXPECT_TRUE(submit_status().ok()) << "the same level counts once";
  scene_.push_back(0);
  const absl::Status refused = submit_status();
  EXPECT_EQ(refused.code(), absl::StatusCode::kResourceExhausted) << refused;
  EXPECT_THAT(std::string(refused.message()), HasSubstr("its quota is"));
  FarmClient client(address());
  EXPECT_EQ(value_or_die(client.jobs()).size(), 2u);
}

}  // namespace
}  // namespace lightloom
