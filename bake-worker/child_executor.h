// Tasks in a process of their own: what ends it, ends no worker, and is told.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "bake-worker/child_process.h"
#include "bake-worker/executor.h"
#include "bake-worker/executor_child.h"

namespace lightloom {

struct ChildOptions {
  ExecutorConfig config;
  /// A program whose main() is serve_executor().
  std::vector<std::string> command = {"/proc/self/exe", "executor"};
  /// Told in one line when a child ended by itself. From another thread.
  std::function<void(const std::string&)> on_end = [](const std::string&) {};
};

/// One child runs all tasks. It is started when a task wants it, and again after it ended.
///
/// A child that ends while a single task runs ends by its fault: the task fails. While several ran, nobody knows whose fault
/// it was: each is run again, alone, before anything else; only one that ends the child alone fails. So is a task that found
/// no memory beside others.
class ChildExecutor final : public TaskExecutor {
 public:
  explicit ChildExecutor(ChildOptions options);
  /// Ends the child. REQUIRES: no run() is under way.
  ~ChildExecutor() override;

  absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control) override;
  /// Unavailable: three children in a row ended before any task did.
  absl::Status health() override;

  /// The child's process id; 0: none runs now.
  pid_t child();

 private:
  struct Call {
    const BakeTask& task;
    const BakeControl& control;
    bool sent = false, cancelling = false;
    bool beside = false;   // others ran meanwhile
    bool suspect = false;  // ran when a child ended, or found no memory beside others: to be run alone
    std::optional<absl::StatusOr<TaskOutput>> result = std::nullopt;
  };

  void keep();
  bool converse(Frames* frames);
  void finish(Call* call, absl::StatusOr<TaskOutput> output);
  void settle(const ChildEnd& end);
  void count_failure(const std::string& what);
  void send_what_may_run();
  bool cancel_if_asked(uint64_t id, Call* call);

  const ChildOptions options_;
  std::mutex mutex_;  // guards all below
  std::condition_variable changed_;
  bool ending_ = false, ready_ = false;
  ChildProcess* child_ = nullptr;
  uint64_t last_id_ = 0;
  std::map<uint64_t, Call*> calls_;  // by age
  int failures_ = 0;                 // ends of children in a row that no task had to do with
  absl::Status health_;
  std::thread keeper_;  // the child ends with the thread that started it (PR_SET_PDEATHSIG): this one outlives it
};

}  // namespace lightloom
