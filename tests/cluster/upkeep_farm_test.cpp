// What keeps a farm's state folder in bounds, while the farm bakes: the asset has the same bytes all the same.
#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>

#include <atomic>
#include <thread>

#include "bake-server/store/sql_upkeep.h"
#include "bake-server/store/sqlite_database.h"
#include "bake-server/store/sqlite_store.h"
#include "bake-server/upkeep/backup.h"
#include "core/base/steady_clock.h"
#include "tests/cluster/farm_fixture.h"
#include "tests/support/previous_schema.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;
using test::FarmTest;
using test::RunningWorker;
using test::value_or_die;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
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
    return client.submit(scene_, params_, nullptr, "cornell", 0, [](uint64_t) {}).status();
  }
  /// Over a connection of its own, as another process.
  Garbage gc(int64_t grace_seconds) {
    const auto database = value_or_die(open_sqlite_reader(state()));
    const References references = [&](const VisitDigest& visit) { return visit_references(*database, visit); };
    return value_or_die(collect_garbage(state(), references, {.grace_seconds = grace_seconds}));
  }
  static void make_old(const fs::path& file) {
    const timespec old[2] = {{1'000'000, 0}, {1'000'000, 0}};
    EXPECT_EQ(::utimensat(AT_FDCWD, file.c_str(), old, 0), 0) << file;
  }
  void make_blobs_old() {
    for (const auto& file : fs::recursive_directory_iterator(state() / "blobs")) {
      if (file.is_regular_file()) make_old(file.path());
    }
  }
  /// Puts old copies of these blobs where none are.
  void leave_old(const fs::path& blobs) {
    const fs::path draft = folder_.path() / "old";
    for (const auto& file : fs::recursive_directory_iterator(blobs)) {
      const fs::path to = state() / "blobs" / fs::relative(file.path(), blobs);
      if (!file.is_regular_file() || fs::exists(to)) continue;
      fs::create_directories(to.parent_path());
      fs::copy_file(file.path(), draft);
      make_old(draft);
      (void)::link(draft.c_str(), to.c_str());  // unlike a rename it replaces nothing
      fs::remove(draft);
    }
  }
  std::vector<std::string> failures(uint64_t job) {
    FarmClient client(address());
    std::vector<std::string> out;
    for (const RemoteEvent& e : value_or_die(client.events(job))) {
      if (e.what.starts_with("failed: ")) out.push_back(e.what);
    }
    return out;
  }
};

/// Collects a task's first result as garbage between its upload and its report, once.
class ForgetfulExecutor final : public TaskExecutor {
 public:
  ForgetfulExecutor(std::unique_ptr<TaskExecutor> executor, std::function<void(const Digest&)> lose)
      : executor_(std::move(executor)), lose_(std::move(lose)) {}
  absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control) override {
    absl::StatusOr<TaskOutput> output = executor_->run(task, control);
    if (output.ok() && task.kind == "cell" && !lost_.exchange(true)) lose_(output->outputs.at(0));
    return output;
  }

 private:
  const std::unique_ptr<TaskExecutor> executor_;
  const std::function<void(const Digest&)> lose_;
  std::atomic<bool> lost_{false};
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
  expect_to_go_on(job.id, 3);
}

TEST_F(UpkeepFarm, AJobThatTheReleaseBeforeBeganIsFinished) {
  const RemoteJob job = submit();
  {
    const RunningWorker worker(dial(address()), "worker");
    bool stopped = false;
    FarmClient client(address(), std::chrono::seconds(1));
    const CancelFlag never;
    // The watch ends with the server.
    (void)client.watch(job.id, never, [&](const RemoteJob& now) {
      if (stopped || now.done < 3 || now.ended()) return;
      stopped = true;
      stop_server();
    });
    ASSERT_TRUE(stopped);
  }
  sqlite3* database = nullptr;
  ASSERT_EQ(sqlite3_open((state() / "store.db").c_str(), &database), SQLITE_OK);
  for (const char* sql : test::kBackToSchema1) {
    EXPECT_EQ(sqlite3_exec(database, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sql;
  }
  sqlite3_close(database);

  expect_to_go_on(job.id, 3);
}

// Without a grace period a result may go between its upload and its report: nothing is promised. What races with one is an
// old blob that is asked for while it goes. So this farm bakes what another has baked, and each blob that nobody has asked
// for yet lies there, old, and is collected, again and again.
TEST_F(UpkeepFarm, GarbageIsCollectedWhileAJobRuns) {
  const fs::path baked_before = folder_.path() / "baked before";
  {
    const RunningWorker worker(dial(address()), "worker", 2);
    ASSERT_EQ(watch(submit().id).state, "done");
  }
  stop_server();
  fs::rename(state() / "blobs", baked_before);
  fs::remove_all(state());
  start_server("127.0.0.1:0");

  const RemoteJob job = submit();
  leave_old(baked_before);
  EXPECT_GT(gc(3600).blobs, 5u);
  std::atomic<bool> ended{false};
  std::thread collector([&] {
    while (!ended) {
      leave_old(baked_before);
      gc(3600);
    }
  });
  RemoteJob end;
  {
    const RunningWorker worker(dial(address()), "worker", 2);
    end = watch(job.id);
  }
  ended = true;
  collector.join();
  ASSERT_EQ(end.state, "done") << end.error;
  EXPECT_THAT(failures(job.id), IsEmpty()) << "who was told that a blob is there did not find it";
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
  const auto reader = value_or_die(SqliteDatabase::open(state() / "store.db", Durability::kProcess));
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
  // As if the worker had been away for long between upload and report.
  std::string lost;
  const auto lose = [&](const Digest& digest) {
    lost = digest.hex();
    make_old(BlobLayout(state() / "blobs").blob(digest));
    EXPECT_EQ(gc(3600).blobs, 1u);
  };
  const auto channel = dial(address());
  RemoteJob end;
  {
    const RunningWorker worker(
        channel, std::make_unique<ForgetfulExecutor>(std::make_unique<LocalExecutor>(channel, 1, 0), lose), "worker",
        1);
    end = watch(job.id);
  }
  ASSERT_EQ(end.state, "done") << end.error;
  EXPECT_THAT(failures(job.id), ElementsAre(HasSubstr("blob " + lost + " is not here")));
  expect_fetched_as_baked(job.id);
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
