// An urgent job beside a hundred thousand queued tasks: real server, store and gRPC; workers that only talk.
#include <gmock/gmock.h>
#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <future>
#include <memory>
#include <string>
#include <vector>

#include "bake-server/grpc/server.h"
#include "bake-worker/join.h"
#include "proto/client.h"
#include "proto/job_service.grpc.pb.h"
#include "proto/worker_service.grpc.pb.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

constexpr int kQueued = 100'000, kUrgent = 10;
constexpr uint32_t kThreads = 2, kRoom = 4;

/// What a worker says, and hears.
class TalkingWorker {
 public:
  TalkingWorker(const std::string& address, const std::string& name)
      : stub_(v1::WorkerService::NewStub(dial(address))), name_(name) {}

  /// Reports what is done, and returns what it got. `wait_ms`: how long the server may wait for something to say.
  std::vector<v1::SyncResponse::Assignment> sync(const std::vector<std::string>& done, uint32_t room,
                                                 uint32_t wait_ms) {
    v1::SyncRequest request;
    const Introduction who = introduce_this_machine(kThreads);
    request.mutable_who()->set_protocol_version(who.protocol_version);
    request.mutable_who()->set_method_version("none");
    request.mutable_who()->set_avx2(true);
    request.mutable_who()->set_threads(kThreads);
    request.set_worker(name_);
    request.set_incarnation(1);
    request.set_sequence(++sequence_);
    request.set_seen(seen_);
    request.set_room(room);
    request.set_wait_ms(wait_ms);
    for (const std::string& attempt : done) {
      held_.erase(attempt);
      request.add_finished()->set_attempt(attempt);
    }
    for (const auto& [attempt, job] : held_) request.add_running()->set_attempt(attempt);
    grpc::ClientContext context;
    v1::SyncResponse response;
    const grpc::Status status = stub_->Sync(&context, request, &response);
    EXPECT_TRUE(status.ok()) << status.error_message();
    seen_ = std::max(seen_, response.sequence());
    std::vector<v1::SyncResponse::Assignment> out(response.assignments().begin(), response.assignments().end());
    for (const auto& a : out) held_[a.attempt()] = a.job();
    return out;
  }
  /// One that it has, of that job.
  std::string one_of(uint64_t job) const {
    const auto at = std::find_if(held_.begin(), held_.end(), [&](const auto& h) { return h.second == job; });
    return at == held_.end() ? "" : at->first;
  }

 private:
  std::unique_ptr<v1::WorkerService::Stub> stub_;
  std::string name_;
  uint64_t sequence_ = 0, seen_ = 0;
  std::map<std::string, uint64_t> held_;  // attempts and their jobs
};

uint64_t submit(v1::JobService::Stub* jobs, const std::string& name, int tasks, int priority) {
  v1::SubmitRequest request;
  request.set_request_id(name + " request, 16 bytes");
  request.set_client("test");
  request.set_name(name);
  request.set_priority(priority);
  request.set_method_version("none");
  for (int i = 0; i < tasks; ++i) {
    auto* task = request.add_tasks();
    task->set_kind("cell");
    task->set_argument(std::to_string(i));
    task->set_order(i);
  }
  grpc::ClientContext context;
  v1::Job job;
  const grpc::Status status = jobs->Submit(&context, request, &job);
  EXPECT_TRUE(status.ok()) << status.error_message();
  return job.id();
}

TEST(Urgent, TenTasksStartNextBesideAHundredThousand) {
  const TemporaryFolder folder;
  const auto farm = value(Farm::open(folder.path()));
  const auto server = value(
      Server::start("127.0.0.1:0", {.version = "1", .protocol_version = 1, .method_version = "none"}, farm.get()));
  const auto jobs = v1::JobService::NewStub(dial(server->address()));
  const uint64_t queued = submit(jobs.get(), "queued", kQueued, 0);
  TalkingWorker v(server->address(), "v"), w(server->address(), "w");
  EXPECT_EQ(v.sync({}, kRoom, 30'000).size(), kRoom);
  EXPECT_EQ(w.sync({}, kRoom, 30'000).size(), kRoom);

  // One waits for news while the job comes in; the other is heard when it has finished a task.
  auto waiting = std::async(std::launch::async, [&] { return v.sync({}, 0, 30'000); });
  const auto began = std::chrono::steady_clock::now();
  const uint64_t urgent = submit(jobs.get(), "urgent", kUrgent, 5);
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
