// An executor child with faults. Without arguments it runs tasks of its own kinds, which need no level:
//   fine        ends at once
//   hold        runs until it is cancelled; has shot one ray
//   crash       SIGSEGV
//   exit        exit code 3
//   hog         allocates without end
//   meet N, crash N, hog N   (argument: the name of a file) the first time, wait until N of them run in this process; then
//               each does as its name says, a "meet" like "hold". Once they have met "meet" and "hog" are "fine"
// With arguments "KIND": as a real executor, but tasks of that kind end it by SIGSEGV.
#include <signal.h>
#include <stdio.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bake-worker/executor_child.h"
#include "bake-worker/local_executor.h"
#include "proto/client.h"

namespace lightloom {
namespace {

[[noreturn]] void crash() {
  ::signal(SIGSEGV, SIG_DFL);  // a sanitizer would make an exit code of it
  ::raise(SIGSEGV);
  ::_exit(126);
}

class Faults final : public TaskExecutor {
 public:
  absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control) override {
    const std::string kind = task.kind.substr(0, task.kind.find(' '));
    if (kind == "exit") ::_exit(3);
    if (kind == "hold") return hold(control);
    const size_t number = task.kind.find(' ');
    if (kind == "hog" && number == std::string::npos) return hog();
    const std::filesystem::path met(std::string(task.argument.begin(), task.argument.end()));
    if (number != std::string::npos && !std::filesystem::exists(met)) {
      meet(std::stoi(task.kind.substr(number)));
      if (kind == "meet") return hold(control);
      std::ofstream(met) << "met";
      if (kind == "hog") return hog();
    }
    if (kind == "crash") crash();
    TaskOutput out;
    out.rays = 7;
    return out;
  }

 private:
  static absl::StatusOr<TaskOutput> hog() {
    std::vector<std::vector<char>> all;
    for (;;) all.emplace_back(size_t{64} << 20);
  }
  static absl::StatusOr<TaskOutput> hold(const BakeControl& control) {
    while (!control.cancel->cancelled()) {
      control.progress("hold", 0, 1, 1);
      std::this_thread::yield();
    }
    return absl::CancelledError("cancelled");
  }
  void meet(int count) {
    std::unique_lock lock(mutex_);
    ++there_;
    changed_.notify_all();
    changed_.wait(lock, [&] { return there_ >= count; });
  }

  std::mutex mutex_;
  std::condition_variable changed_;
  int there_ = 0;
};

class CrashesOn final : public TaskExecutor {
 public:
  CrashesOn(std::string kind, const ExecutorConfig& config)
      : kind_(std::move(kind)), real_(dial(config.server), config.threads, config.cache_bytes) {}
  absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control) override {
    if (task.kind == kind_) crash();
    return real_.run(task, control);
  }

 private:
  const std::string kind_;
  LocalExecutor real_;
};

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) {
  return lightloom::serve_executor(
      [&](const lightloom::ExecutorConfig& config) -> std::unique_ptr<lightloom::TaskExecutor> {
        if (argc < 2) return std::make_unique<lightloom::Faults>();
        return std::make_unique<lightloom::CrashesOn>(argv[1], config);
      });
}
