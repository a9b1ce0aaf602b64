#include "bake-server/coordinator/dispatcher.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class DispatcherTest : public testing::Test {
 protected:
  DispatcherTest()
      : store_(value(open_sqlite_store(folder_.path()))),
        blobs_(value(BlobStore::open(folder_.path() / "blobs"))),
        dispatcher_(store_.get(), blobs_.get(), DispatchOptions()) {}

  SyncMessage message(const std::string& worker, uint32_t room) {
    SyncMessage m;
    m.worker = worker;
    m.threads = 1;
    m.incarnation = 1;
    m.sequence = ++sequence_;
    m.seen = ~uint64_t{0} >> 1;
    m.room = room;
    m.wait_ms = 10'000;
    for (const std::string& attempt : held_[worker]) m.running.push_back({attempt, 0});
    return m;
  }
  void hear(const SyncMessage& m) {
    dispatcher_.hear(
        m, [this, worker = m.worker](const absl::StatusOr<SyncAnswer>& a) { answers_[worker] = a; }, now_);
  }
  /// What those who wait are told now, by worker.
  std::map<std::string, absl::StatusOr<SyncAnswer>> step() {
    answers_.clear();
    for (auto& a : dispatcher_.step(now_)) a.to(std::move(a.answer));
    for (auto& [worker, answer] : answers_) {
      if (!answer.ok()) continue;
      for (const Assignment& a : answer->assignments) held_[worker].push_back(a.attempt);
    }
    return answers_;
  }
  void submit(const std::string& payload) {
    NewJob job = new_job(payload, {{"plan", 0, "", 0}});
    job.payload = payload;
    value(store_->submit(job, now_));
  }

  const TemporaryFolder folder_;
  const std::unique_ptr<Store> store_;
  const std::unique_ptr<BlobStore> blobs_;
  Dispatcher dispatcher_;
  int64_t now_ = 1'000'000;
  uint64_t sequence_ = 0;
  std::map<std::string, std::vector<std::string>> held_;
  std::map<std::string, absl::StatusOr<SyncAnswer>> answers_;
};

TEST_F(DispatcherTest, WhoHasNothingToDoWarmsUpOnce) {
  submit("level");
  hear(message("v", 1));
  hear(message("w", 1));
  auto told = step();
  ASSERT_EQ(told.size(), 1u) << "one task, one worker";
  const std::string idle = told.contains("v") ? "w" : "v";
  EXPECT_THAT(told.begin()->second->warm, IsEmpty()) << "it plans already";
  EXPECT_EQ(told.begin()->second->assignments.front().kind, "plan");

  told = step();
  ASSERT_EQ(told.size(), 1u);
  EXPECT_THAT(told.at(idle)->warm, ElementsAre("level"));
  EXPECT_THAT(told.at(idle)->assignments, IsEmpty());
  hear(message(idle, 1));
  EXPECT_THAT(step(), IsEmpty()) << "it knows";
  hear(message("x", 0));
  EXPECT_THAT(step(), IsEmpty()) << "it is busy";
}

TEST_F(DispatcherTest, ANewerSyncAnswersTheOlder) {
  hear(message("w", 1));
  EXPECT_THAT(step(), IsEmpty());
  hear(message("w", 1));
  EXPECT_EQ(step().at("w").status().code(), absl::StatusCode::kAborted);
  now_ += 10'000;
  EXPECT_TRUE(step().at("w").ok()) << "its wait is over";
}

TEST_F(DispatcherTest, WhileItIsPausedNothingIsGivenOut) {
  bool paused = true;
  DispatchOptions options;
  options.paused = [&] { return paused; };
  dispatcher_ = Dispatcher(store_.get(), blobs_.get(), options);
  submit("level");
  hear(message("w", 1));
  EXPECT_THAT(step(), IsEmpty());
  paused = false;
  EXPECT_EQ(step().at("w")->assignments.size(), 1u);
}

TEST_F(DispatcherTest, WhatAFailedAnswerCarriedIsSentAgain) {
  submit("level");
  hear(message("w", 1));
  dispatcher_.step(now_);  // the answer is lost
  SyncMessage again = message("w", 1);
  again.seen = 0;
  hear(again);
  EXPECT_EQ(step().at("w")->assignments.front().payload, "level");
}

}  // namespace
}  // namespace lightloom::test
