#include "bake-worker/child_executor.h"

#include <algorithm>
#include <chrono>

#include "bake-worker/executor.pb.h"
#include "bake-worker/task_messages.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

constexpr int kMostFailures = 3;
constexpr std::chrono::milliseconds kLookForCancel{20};

absl::Status failure_of(const std::string& what, const ChildEnd& end) {
  return end.of_memory ? absl::ResourceExhaustedError(what + "; give the worker more memory, or fewer --threads")
                       : absl::InternalError(what);
}

}  // namespace

ChildExecutor::ChildExecutor(ChildOptions options) : options_(std::move(options)), keeper_([this] { keep(); }) {}

ChildExecutor::~ChildExecutor() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    if (child_ != nullptr) child_->kill();
  }
  changed_.notify_all();
  keeper_.join();
}

absl::Status ChildExecutor::health() {
  const std::lock_guard lock(mutex_);
  return health_;
}

pid_t ChildExecutor::child() {
  const std::lock_guard lock(mutex_);
  return child_ != nullptr ? child_->pid() : 0;
}

absl::StatusOr<TaskOutput> ChildExecutor::run(const BakeTask& task, const BakeControl& control) {
  Call call{task, control};
  std::unique_lock lock(mutex_);
  if (!health_.ok()) return health_;
  const uint64_t id = ++last_id_;
  calls_.emplace(id, &call);
  send_what_may_run();
  changed_.notify_all();
  while (!call.result) {
    if (cancel_if_asked(id, &call)) break;
    changed_.wait_for(lock, kLookForCancel);
  }
  calls_.erase(id);
  send_what_may_run();
  return *std::move(call.result);
}

/// True if it need not be waited for.
bool ChildExecutor::cancel_if_asked(uint64_t id, Call* call) {
  if (call->cancelling || call->control.cancel == nullptr || !call->control.cancel->cancelled()) return false;
  call->cancelling = true;
  if (!call->sent) {
    call->result = absl::CancelledError("task '" + call->task.kind + "' cancelled");
    return true;
  }
  if (child_ == nullptr) return false;  // it has ended: settle() follows
  executor::Command command;
  command.mutable_cancel()->set_id(id);
  (void)child_->frames().write(command.SerializeAsString());
  return false;
}

/// All that wait; one after the other while there are suspects.
void ChildExecutor::send_what_may_run() {
  if (!ready_) return;
  const auto any = [&](bool Call::*is) {
    return std::any_of(calls_.begin(), calls_.end(), [&](const auto& c) { return c.second->*is; });
  };
  const bool doubt = any(&Call::suspect);
  for (const auto& [id, call] : calls_) {
    if (call->sent || call->result) continue;
    call->beside = any(&Call::sent);
    if (doubt && (!call->suspect || call->beside)) continue;
    for (const auto& [other_id, other] : calls_) other->beside |= other->sent;
    call->sent = true;
    executor::Command command;
    command.mutable_run()->set_id(id);
    command.mutable_run()->set_threads(static_cast<uint32_t>(call->control.threads));
    to_proto(call->task, command.mutable_run()->mutable_task());
    if (!child_->frames().write(command.SerializeAsString()).ok()) return;  // it has ended: settle() follows
  }
}

void ChildExecutor::keep() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] {
      return ending_ || (health_.ok() && std::any_of(calls_.begin(), calls_.end(),
                                                     [](const auto& call) { return !call.second->result; }));
    });
    if (ending_) return;
    lock.unlock();
    auto started = ChildProcess::start(options_.command);
    lock.lock();
    if (!started.ok()) {
      count_failure(std::string(started.status().message()));
      continue;
    }
    child_ = started->get();
    if (ending_) child_->kill();
    lock.unlock();
    if (!converse(&(*started)->frames())) (*started)->kill();
    lock.lock();
    child_ = nullptr;  // from here on nobody kills a process that may be gone
    ready_ = false;
    lock.unlock();
    const ChildEnd end = (*started)->wait();
    lock.lock();
    if (ending_) return;
    settle(end);
  }
}

/// Until the child ends. False: it says what no child of this program would.
bool ChildExecutor::converse(Frames* frames) {
  executor::Command command;
  command.mutable_begin()->set_server(options_.config.server);
  command.mutable_begin()->set_threads(options_.config.threads);
  command.mutable_begin()->set_cache_bytes(options_.config.cache_bytes);
  command.mutable_begin()->set_memory_bytes(options_.config.memory_bytes);
  (void)frames->write(command.SerializeAsString());
  for (;;) {
    const auto bytes = frames->read();
    if (!bytes.ok()) return false;
    if (!*bytes) return true;
    executor::Report report;
    if (!report.ParseFromString(**bytes)) return false;

    const std::lock_guard lock(mutex_);
    if (report.has_ready()) ready_ = true;
    if (report.has_progress()) {
      const auto at = calls_.find(report.progress().id());
      if (at != calls_.end() && at->second->control.progress) {
        at->second->control.progress(at->second->task.kind, 0, 0, report.progress().rays());
      }
      continue;
    }
    if (report.has_finished()) {
      const executor::Report::Finished& finished = report.finished();
      failures_ = 0;
      if (const auto at = calls_.find(finished.id()); at != calls_.end()) {
        const auto code = static_cast<absl::StatusCode>(finished.code());
        finish(at->second,
               code == absl::StatusCode::kOk ? to_output(finished.output()) : absl::Status(code, finished.message()));
      }
    }
    send_what_may_run();
    changed_.notify_all();
  }
}

void ChildExecutor::finish(Call* call, absl::StatusOr<TaskOutput> output) {
  call->sent = false;
  call->suspect = is_out_of_memory(output.status()) && call->beside && !call->cancelling;
  if (!call->suspect) call->result = std::move(output);
}

void ChildExecutor::settle(const ChildEnd& end) {
  std::vector<Call*> ran;
  for (const auto& [id, call] : calls_) {
    if (call->sent) ran.push_back(call);
    if (call->sent && call->cancelling) call->result = absl::CancelledError("task '" + call->task.kind + "' cancelled");
    call->sent = false;
  }
  if (ran.empty()) {
    count_failure("the executor ended: " + end.how);
  } else if (ran.size() == 1) {
    Call* const call = ran.front();
    const std::string what = "task '" + printable(call->task.kind, 64) + "' ended its executor: " + end.how;
    options_.on_end(what);
    call->suspect = false;
    if (!call->result) call->result = failure_of(what, end);
  } else {
    options_.on_end("the executor ended while " + std::to_string(ran.size()) + " tasks ran: " + end.how +
                    "; each is run again alone");
    for (Call* call : ran) call->suspect = !call->result;
  }
  changed_.notify_all();
}

void ChildExecutor::count_failure(const std::string& what) {
  options_.on_end(what);
  if (++failures_ >= kMostFailures) {
    health_ = absl::UnavailableError(what + ", " + std::to_string(kMostFailures) +
                                     " times in a row and without a task; look whether this machine has the memory "
                                     "and the libraries that lightloom-worker needs");
    for (const auto& [id, call] : calls_) {
      if (!call->result) call->result = health_;
    }
  }
  changed_.notify_all();
}

}  // namespace lightloom
