// A worker that only talks: it says that tasks are done, and hears what comes next.
#pragma once

#include <grpcpp/grpcpp.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "bake-worker/join.h"
#include "proto/client.h"
#include "proto/job_service.grpc.pb.h"
#include "proto/worker_service.grpc.pb.h"

namespace lightloom::test {

class TalkingWorker {
 public:
  TalkingWorker(const std::string& address, std::string name, uint32_t threads = 1)
      : stub_(v1::WorkerService::NewStub(dial(address))), name_(std::move(name)), threads_(threads) {}

  /// Reports what is done, with these outputs, and returns what it got. `wait_ms`: how long the server may wait for something to
  /// say.
  std::vector<v1::SyncResponse::Assignment> sync(const std::vector<std::string>& done, uint32_t room, uint32_t wait_ms,
                                                 const std::vector<std::string>& outputs = {}) {
    v1::SyncRequest request;
    const Introduction who = introduce_this_machine(threads_);
    request.mutable_who()->set_protocol_version(who.protocol_version);
    request.mutable_who()->set_method_version("none");
    request.mutable_who()->set_avx2(true);
    request.mutable_who()->set_threads(threads_);
    request.set_worker(name_);
    request.set_incarnation(1);
    request.set_sequence(++sequence_);
    request.set_seen(seen_);
    request.set_room(room);
    request.set_wait_ms(wait_ms);
    for (size_t i = 0; i < done.size(); ++i) {
      held_.erase(done[i]);
      auto* finished = request.add_finished();
      finished->set_attempt(done[i]);
      if (!outputs.empty()) finished->add_outputs(outputs[i]);
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
  const std::string name_;
  const uint32_t threads_;
  uint64_t sequence_ = 0, seen_ = 0;
  std::map<std::string, uint64_t> held_;  // attempts and their jobs
};

/// Tasks that mean nothing. Returns the job.
inline uint64_t submit_tasks(v1::JobService::Stub* jobs, const std::string& name, int tasks, int priority) {
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

}  // namespace lightloom::test
