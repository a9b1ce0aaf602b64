// An urgent job beside a hundred thousand queued tasks: real server, store and gRPC; workers that only talk.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <future>
#include <string>
#include <vector>

#include "bake-server/grpc/server.h"
#include "tests/support/talking_worker.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

constexpr int kQueued = 100'000, kUrgent = 10;
constexpr uint32_t kThreads = 2, kRoom = 4;

TEST(Urgent, TenTasksStartNextBesideAHundredThousand) {
  const TemporaryFolder folder;
  const auto farm = value(Farm::open(folder.path()));
  const auto server = value(
      Server::start("127.0.0.1:0", {.version = "1", .protocol_version = 1, .method_version = "none"}, farm.get()));
  const auto jobs = v1::JobService::NewStub(dial(server->address()));
  const uint64_t queued = submit_tasks(jobs.get(), "queued", kQueued, 0);
  TalkingWorker v(server->address(), "v", kThreads), w(server->address(), "w", kThreads);
  EXPECT_EQ(v.sync({}, kRoom, 30'000).size(), kRoom);
  EXPECT_EQ(w.sync({}, kRoom, 30'000).size(), kRoom);

  // One waits for news while the job comes in; the other is heard when it has finished a task.
  auto waiting = std::async(std::launch::async, [&] { return v.sync({}, 0, 30'000); });
  const auto began = std::chrono::steady_clock::now();
  const uint64_t urgent = submit_tasks(jobs.get(), "urgent", kUrgent, 5);
  const auto overtaking = waiting.get();
  const double ms = 1e3 * std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
  std::printf("urgent tasks are with a worker %.1f ms after their job was sent, beside %d queued\n", ms, kQueued);
  EXPECT_EQ(overtaking.size(), kThreads) << "one for each thread, before what is queued there";
  size_t urgent_given = overtaking.size();
  for (const auto& a : overtaking) {
    EXPECT_EQ(a.job(), urgent);
    EXPECT_EQ(a.priority(), 5);
  }
  // Each task that ends is followed by an urgent one, while there are any.
  for (TalkingWorker* worker = &w; urgent_given < kUrgent; worker = worker == &v ? &w : &v) {
    std::string ended = worker->one_of(urgent);
    if (ended.empty()) ended = worker->one_of(queued);
    for (const auto& a : worker->sync({ended}, 1, 30'000)) {
      ASSERT_EQ(a.job(), urgent) << "after " << urgent_given;
      ++urgent_given;
    }
  }
  EXPECT_EQ(urgent_given, kUrgent);
  for (const auto& a : v.sync({v.one_of(queued)}, 1, 30'000)) EXPECT_EQ(a.job(), queued);
}

}  // namespace
}  // namespace lightloom::test
