#include "bake-worker/executor_child.h"

#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cstdio>
#include <map>
#include <mutex>
#include <new>
#include <optional>
#include <system_error>
#include <thread>

#include "bake-worker/child_process.h"
#include "bake-worker/executor.pb.h"
#include "bake-worker/frames.h"
#include "bake-worker/local_executor.h"
#include "bake-worker/task_messages.h"
#include "proto/client.h"

namespace lightloom {
namespace {

constexpr std::chrono::milliseconds kProgressEvery{200};

std::optional<executor::Command> read_command(Frames* frames) {
  const auto bytes = frames->read();
  executor::Command command;
  if (!bytes.ok() || !*bytes || !command.ParseFromString(**bytes)) return std::nullopt;
  return command;
}

/// Tasks that run, each in a thread of its own. Never destroyed: the process ends in the middle of them.
class Tasks {
 public:
  Tasks(Frames* frames, TaskExecutor* executor) : frames_(frames), executor_(executor) {}

  void begin(const executor::Command::Run& run) try {
    const auto cancel = std::make_shared<CancelFlag>();
    {
      const std::lock_guard lock(mutex_);
      cancels_[run.id()] = cancel;
    }
    std::thread([this, run, cancel] { finish(run.id(), execute(run, cancel.get())); }).detach();
  } catch (const std::system_error&) {  // no thread, as there is no room for its stack
    finish(run.id(), out_of_memory(run.task().kind()));
  } catch (const std::bad_alloc&) {
    finish(run.id(), out_of_memory(run.task().kind()));
  }
  void cancel(uint64_t id) {
    const std::lock_guard lock(mutex_);
    if (const auto at = cancels_.find(id); at != cancels_.end()) at->second->cancel();
  }

 private:
  absl::StatusOr<TaskOutput> execute(const executor::Command::Run& run, const CancelFlag* cancel) try {
    BakeControl control;
    control.threads = static_cast<int>(run.threads());
    control.cancel = cancel;
    auto told = std::chrono::steady_clock::now();
    control.progress = [&](const std::string&, uint64_t, uint64_t, uint64_t rays) {
      const auto now = std::chrono::steady_clock::now();
      if (now - told < kProgressEvery) return;
      told = now;
      executor::Report report;
      report.mutable_progress()->set_id(run.id());
      report.mutable_progress()->set_rays(rays);
      send(report);
    };
    return run_within_memory(executor_, to_task(run.task()), control);
  } catch (const std::bad_alloc&) {  // before it ran
    return out_of_memory(run.task().kind());
  }
  void finish(uint64_t id, const absl::StatusOr<TaskOutput>& output) {
    {
      const std::lock_guard lock(mutex_);
      cancels_.erase(id);
    }
    executor::Report report;
    executor::Report::Finished* finished = report.mutable_finished();
    finished->set_id(id);
    finished->set_code(static_cast<int>(output.status().code()));
    finished->set_message(std::string(output.status().message()));
    if (output.ok()) to_proto(*output, finished->mutable_output());
    send(report);
  }
  /// If nobody hears it, the process is about to end.
  void send(const executor::Report& report) { (void)frames_->write(report.SerializeAsString()); }

  Frames* const frames_;
  TaskExecutor* const executor_;
  std::mutex mutex_;
  std::map<uint64_t, std::shared_ptr<CancelFlag>> cancels_;
};

/// Of what can be written to, heap and stacks: libraries, and what allocators have set aside only, do not count.
void limit_memory(uint64_t bytes) {
  if (bytes == 0) return;
  const rlimit limit{bytes, bytes};
  ::setrlimit(RLIMIT_DATA, &limit);
}

}  // namespace

int serve_executor(const std::function<std::unique_ptr<TaskExecutor>(const ExecutorConfig&)>& make) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  // The supervisor decides what they mean.
  ::signal(SIGINT, SIG_IGN);
  ::signal(SIGTERM, SIG_IGN);

  auto* const frames = new Frames(kChildSocket);
  auto command = read_command(frames);
  if (!command || !command->has_begin()) {
    std::fputs("executor: no supervisor is there; start lightloom-worker without this argument\n", stderr);
    return 2;
  }
  const executor::Command::Begin& begin = command->begin();
  limit_memory(begin.memory_bytes());
  auto* const tasks =
      new Tasks(frames, make({begin.server(), begin.threads(), begin.cache_bytes(), begin.memory_bytes()}).release());
  executor::Report ready;
  ready.mutable_ready();
  (void)frames->write(ready.SerializeAsString());

  while ((command = read_command(frames))) {
    if (command->has_run()) tasks->begin(command->run());
    if (command->has_cancel()) tasks->cancel(command->cancel().id());
  }
  ::_exit(0);  // at once: tasks may be running, and nobody waits for them
}

int executor_main() {
  return serve_executor([](const ExecutorConfig& config) {
    return std::make_unique<LocalExecutor>(dial(config.server), config.threads, config.cache_bytes);
  });
}

}  // namespace lightloom
