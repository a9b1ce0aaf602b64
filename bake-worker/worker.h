// A worker: asks for tasks, runs them, reports. Survives a server that goes away and comes back.
#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bake-worker/join.h"
#include "core/bake/task_runner.h"

namespace grpc {
class Channel;
class ClientContext;
}  // namespace grpc

namespace lightloom {

struct WorkerOptions {
  std::string name;     ///< [A-Za-z0-9._-], 1 to 64; stays the same when the process restarts
  Introduction who;     ///< who.threads: tasks at once
  size_t sessions = 2;  ///< levels that are kept warm
  /// A level that is at hand, and the payload of its tasks; may be null.
  std::vector<uint8_t> payload = {};
  std::shared_ptr<const BakeSession> session = nullptr;
};

/// Blobs on the server, to a TaskRunner.
std::unique_ptr<BlobAccess> remote_blobs(std::shared_ptr<grpc::Channel> channel);

class Worker {
 public:
  Worker(std::shared_ptr<grpc::Channel> channel, WorkerOptions options);
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Works until drain() or stop(), or until the server refuses it: FailedPrecondition with the reason.
  absl::Status run();
  /// Takes no more tasks; run() returns when those that it has are done and on record. Any thread.
  void drain();
  /// Hands back what runs; run() returns soon. Any thread.
  void stop();

 private:
  struct Running {
    BakeTask task;
    std::atomic<uint64_t> rays{0};
    CancelFlag cancel;
    bool lost = false;  // nobody waits for it any more
  };

  void execute();
  absl::Status sync_once(bool* idle);
  void run_task(const std::string& attempt, Running* running);

  std::shared_ptr<grpc::Channel> channel_;
  const WorkerOptions options_;
  std::unique_ptr<BlobAccess> blobs_;
  TaskRunner runner_;

  std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  bool draining_ = false, stopping_ = false, ended_ = false;
  std::map<std::string, std::shared_ptr<Running>> running_;
  std::deque<std::string> queue_;                               // assigned, not begun
  std::map<std::string, absl::StatusOr<TaskOutput>> finished_;  // to be reported until acknowledged
  std::vector<std::string> released_;
  grpc::ClientContext* waiting_ = nullptr;  // a Sync that news should end
  uint64_t incarnation_ = 0, sequence_ = 0, seen_ = 0;
  std::vector<std::thread> threads_;
};

}  // namespace lightloom
