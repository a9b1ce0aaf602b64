// Two servers on one PostgreSQL database and one folder of blobs.
#include <gtest/gtest.h>

#include <atomic>
#include <filesystem>
#include <set>
#include <string>

#include "bake-server/upkeep/backup.h"
#include "tests/cluster/farm_fixture.h"
#include "tests/support/postgres_server.h"

namespace lightloom::test {
namespace {

class CoordinatorsTest : public FarmTest {
 protected:
  void SetUp() override {
    static std::atomic<int> databases = 0;
    database_ = PostgresServer::shared().database("farm_" + std::to_string(++databases));
    FarmTest::SetUp();
    CoordinatorOptions options;
    options.dispatch.lease_ms = 5'000;
    other_farm_ = value_or_die(Farm::open(folder_.path() / "state", options, Durability::kPowerLoss, {}, database_));
    other_ = value_or_die(Server::start("127.0.0.1:0", this_release(), other_farm_.get()));
  }
  void stop_other() {
    other_.reset();
    other_farm_.reset();
  }

  std::unique_ptr<Farm> other_farm_;
  std::unique_ptr<Server> other_;
};

TEST_F(CoordinatorsTest, SubmittedToOneBakedOnTheOther) {
  const RunningWorker worker(dial(other_->address()), "worker");
  const RemoteJob job = submit();
  EXPECT_EQ(watch(job.id).state, "done");
  expect_fetched_as_baked(job.id);
}

TEST_F(CoordinatorsTest, BothGiveOutTasksOfOneJobAndTheBytesAreTheSame) {
  const RunningWorker a(dial(address()), "a"), b(dial(other_->address()), "b");
  const RemoteJob job = submit();
  EXPECT_EQ(watch(job.id).state, "done");
  expect_fetched_as_baked(job.id);
  std::set<std::string> workers;
  FarmClient client(address());
  for (const auto& event : value_or_die(client.events(job.id))) workers.insert(event.worker);
  EXPECT_TRUE(workers.contains("a") && workers.contains("b"));
}

TEST_F(CoordinatorsTest, CancelledOnOneStopsWorkOfTheOther) {
  const RemoteJob job = submit();
  std::atomic<bool> cancelled = false;
  const RunningWorker worker(dial(other_->address()), "worker");
  const RemoteJob ended = watch(job.id, [&](const RemoteJob& now) {
    if (now.running > 0 && !cancelled.exchange(true)) {
      FarmClient client(address());
      (void)value_or_die(client.cancel(job.id));
    }
  });
  EXPECT_EQ(ended.state, "cancelled");
  // The worker of the other one is free again.
  const RemoteJob next = submit();
  EXPECT_EQ(watch(next.id).state, "done");
}

TEST_F(CoordinatorsTest, OneDiesAndTheOtherFinishes) {
  const RunningWorker lost(dial(other_->address()), "lost");
  const RemoteJob job = submit();
  bool died = false;
  const RunningWorker survivor(dial(address()), "survivor");
  const RemoteJob ended = watch(job.id, [&](const RemoteJob& now) {
    if (now.done < 3 || died) return;
    died = true;
    stop_other();
  });
  EXPECT_TRUE(died);
  EXPECT_EQ(ended.state, "done");
  expect_fetched_as_baked(job.id);
}

TEST_F(CoordinatorsTest, ABackupFromTheMiddleOfAJobGoesOnInAnotherDatabase) {
  const std::filesystem::path state = folder_.path() / "state", copy = folder_.path() / "copy";
  const RemoteJob job = submit();
  {
    const RunningWorker worker(dial(address()), "worker");
    bool copied = false;
    EXPECT_EQ(watch(job.id,
                    [&](const RemoteJob& now) {
                      if (copied || now.done < 3 || now.ended()) return;
                      copied = true;
                      EXPECT_GT(value_or_die(back_up(state, copy, nullptr, database_)).blobs, 2u);
                    })
                  .state,
              "done");
    ASSERT_TRUE(copied);
  }
  stop_other();
  stop_server();
  std::filesystem::remove_all(state);
  std::filesystem::rename(copy, state);
  database_ = PostgresServer::shared().database("restored");
  ASSERT_TRUE(restore(state, database_).ok());
  expect_to_go_on(job.id, 3);
}

}  // namespace
}  // namespace lightloom::test
