// A worker: asks for tasks, has them run, reports. Survives a server that goes away and comes back.
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <thread>
#include <vector>

#include "bake-worker/executor.h"
#include "bake-worker/join.h"

namespace grpc {
class Channel;
class ClientContext;
}  // namespace grpc

namespace lightloom {

struct WorkerOptions {
  std::string name;  ///< by the rule of proto/worker_name.h; no two workers share one
  Introduction who;  ///< who.threads: tasks that compute at once
  /// Told in one line: that Syncs fail and why, once for each kind of error, and that they work again; that many tasks
  /// in a row failed. From any thread of the worker.
  std::function<void(const std::string&)> on_trouble = [](const std::string&) {};
  /// Whether a server whose disk is full is waited for. The executor's setting should be the same.
  bool wait_for_room = true;
};

/// Begins somewhat more tasks than may compute, so that cores have work while results are on their way, and has more of
/// them in hand where they are short, so that many share one Sync.
class Worker {
 public:
  /// The executor must outlive the worker.
  Worker(std::shared_ptr<grpc::Channel> channel, TaskExecutor* executor, WorkerOptions options);
  ~Worker();
  Worker(const Worker&) = delete;
  Worker& operator=(const Worker&) = delete;

  /// Works until drain() or stop(); until the server refuses it: FailedPrecondition with the reason; until the executor can
  /// run no more tasks: Unavailable with the reason, when what it had is handed back; until the server's disk is full, if
  /// that is not waited for: ResourceExhausted with the reason.
  absl::Status run();
  /// Takes no more tasks; run() returns when those that it has begun are done and on record. Any thread.
  void drain();
  /// Hands back what runs; run() returns soon. Any thread.
  void stop();

 private:
  using Clock = std::chrono::steady_clock;
  struct Running {
    BakeTask task;
    std::atomic<uint64_t> rays{0};
    CancelFlag cancel;
    bool lost = false;  // nobody waits for it, or not any more
    bool warm = false;  // nobody ever did: it makes a level ready for tasks that are on their way
  };
  struct Report {
    absl::StatusOr<TaskOutput> output;
    std::optional<Digest> tasks_blob;  // holds output.spawned, which is empty then
  };

  void execute();
  void run_task(const std::string& attempt, Running* running);
  Report report_of(absl::StatusOr<TaskOutput> output, const CancelFlag& cancel);
  bool is_final(const absl::Status& status) const;
  absl::Status sync_once();
  void note(const absl::Status& sync);
  /// These need mutex_.
  void drain_locked();
  void stop_locked();
  uint32_t room() const;
  bool has(const std::string& attempt) const;
  void take_warm_up(const std::string& payload);
  void cancel_warm_ups_for(const BakeTask& task);
  bool has_news() const { return !finished_.empty() || !released_.empty(); }
  Clock::time_point next_sync() const;
  void tell();
  void lose(const std::string& attempt);

  std::shared_ptr<grpc::Channel> channel_;
  TaskExecutor& executor_;
  const WorkerOptions options_;

  std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  bool draining_ = false, stopping_ = false, ended_ = false;
  std::map<std::string, std::shared_ptr<Running>> running_;    // by attempt: begun or not
  std::map<std::pair<int64_t, uint64_t>, std::string> queue_;  // not begun, by (-priority, arrival)
  std::map<std::string, Report> finished_;                     // to be reported until acknowledged
  std::vector<std::string> released_;
  absl::Status health_;                    // an error: no task can be done here any more
  bool hungry_ = true;                     // the server had less than there was room for
  Clock::time_point synced_, news_since_;  // last answer; first news since the last Sync was sent
  double mean_seconds_ = 0;                // of recent tasks; 0: not known
  uint64_t arrivals_ = 0;
  int failed_in_row_ = 0;                   // tasks
  grpc::ClientContext* waiting_ = nullptr;  // a Sync that news should end
  bool interrupted_ = false;                // news did end the last Sync
  uint64_t incarnation_ = 0, sequence_ = 0, seen_ = 0;
  std::vector<std::thread> threads_;

  std::set<absl::StatusCode> troubles_;  // told since Syncs worked; of run()'s thread
};

}  // namespace lightloom
