#include "bake-worker/worker.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <random>

#include "bake-worker/task_messages.h"
#include "proto/client.h"
#include "proto/worker_service.grpc.pb.h"

namespace lightloom {
namespace {

constexpr std::chrono::milliseconds kProgressEvery{1000}, kIdleWait{10'000}, kCallDeadline{20'000}, kRetry{500};
/// So long news wait for more, while there is work in hand.
constexpr std::chrono::milliseconds kTogether{100};
/// Work that is kept in hand for each thread, seconds; at most as many tasks as are begun at once.
constexpr double kAheadSeconds = 0.25;

/// More than threads: some wait for the network.
uint32_t begun_at_once(uint32_t threads) { return threads + 1 + threads / 8; }

/// The server will not hear of this worker, however often it asks. `known`: it has heard of it before.
bool is_final(const absl::Status& status, bool known) {
  // A server that is stopping answers as if it had no such call.
  return absl::IsFailedPrecondition(status) || absl::IsInvalidArgument(status) ||
         (absl::IsUnimplemented(status) && !known);
}

}  // namespace

Worker::Worker(std::shared_ptr<grpc::Channel> channel, TaskExecutor* executor, WorkerOptions options)
    : channel_(std::move(channel)), executor_(*executor), options_(std::move(options)) {
  std::random_device random;
  incarnation_ = uint64_t{random()} << 32 | random() | 1;
  for (uint32_t i = 0; i < begun_at_once(options_.who.threads); ++i) threads_.emplace_back([this] { execute(); });
}

Worker::~Worker() {
  {
    const std::lock_guard lock(mutex_);
    ended_ = true;
    for (auto& [attempt, running] : running_) running->cancel.cancel();
  }
  changed_.notify_all();
  for (std::thread& t : threads_) t.join();
}

void Worker::drain() {
  const std::lock_guard lock(mutex_);
  drain_locked();
}

void Worker::drain_locked() {
  draining_ = true;
  for (const auto& [place, attempt] : queue_) {
    if (!running_.at(attempt)->lost) released_.push_back(attempt);
    running_.erase(attempt);
  }
  queue_.clear();
  for (auto& [attempt, running] : running_) {
    if (running->lost) running->cancel.cancel();
  }
  tell();
}

void Worker::stop() {
  const std::lock_guard lock(mutex_);
  drain_locked();
  stopping_ = true;
  for (auto& [attempt, running] : running_) running->cancel.cancel();
}

/// There may be something to say.
void Worker::tell() {
  if (has_news() && news_since_ == Clock::time_point()) news_since_ = Clock::now();
  if (waiting_ != nullptr) waiting_->TryCancel();
  changed_.notify_all();
}

void Worker::execute() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return ended_ || !queue_.empty(); });
    if (ended_) return;
    const std::string attempt = queue_.begin()->second;
    queue_.erase(queue_.begin());
    if (queue_.empty()) changed_.notify_all();  // time for a Sync, if there is news
    const std::shared_ptr<Running> running = running_.at(attempt);
    lock.unlock();
    run_task(attempt, running.get());
    lock.lock();
  }
}

void Worker::run_task(const std::string& attempt, Running* running) {
  BakeControl control;
  control.threads = static_cast<int>(options_.who.threads);
  control.cancel = &running->cancel;
  control.progress = [running](const std::string&, uint64_t, uint64_t, uint64_t rays) { running->rays = rays; };
  const Clock::time_point begun = Clock::now();
  absl::StatusOr<TaskOutput> output = absl::CancelledError("cancelled");
  if (!running->cancel.cancelled()) output = run_within_memory(&executor_, running->task, control);
  const double seconds = std::chrono::duration<double>(Clock::now() - begun).count();
  const absl::Status health = output.ok() ? absl::OkStatus() : executor_.health();

  const std::lock_guard lock(mutex_);
  if (!health.ok() && health_.ok()) {
    health_ = health;
    drain_locked();
  }
  if (running->lost) {
    hungry_ = true;
  } else if (absl::IsCancelled(output.status()) || !health.ok()) {
    released_.push_back(attempt);
  } else {
    if (output.ok()) mean_seconds_ = mean_seconds_ > 0 ? (mean_seconds_ + seconds) / 2 : seconds;
    finished_.emplace(attempt, std::move(output));
  }
  running_.erase(attempt);
  tell();
}

absl::Status Worker::run() {
  for (;;) {
    const absl::Status status = sync_once();
    if (is_final(status, synced_ != Clock::time_point())) return status;
    std::unique_lock lock(mutex_);
    if (draining_ && running_.empty() && !has_news()) return health_;
    if (stopping_ && !status.ok()) return health_;  // nobody hears what is handed back: its lease ends
    if (absl::IsAborted(status) || absl::IsCancelled(status)) continue;
    if (status.ok()) {
      for (auto at = next_sync(); Clock::now() < at; at = next_sync()) changed_.wait_until(lock, at);
    } else {
      changed_.wait_for(lock, kRetry, [&] { return stopping_; });
    }
  }
}

Worker::Clock::time_point Worker::next_sync() const {
  constexpr Clock::time_point kNow{};
  if (draining_ && running_.empty()) return kNow;
  if (has_news()) return queue_.empty() ? kNow : std::min(news_since_ + kTogether, synced_ + kProgressEvery);
  return hungry_ && room() > 0 ? kNow : synced_ + kProgressEvery;
}

/// Tasks that it would take now.
uint32_t Worker::room() const {
  if (draining_) return 0;
  const uint32_t threads = options_.who.threads, most = begun_at_once(threads);
  const double ahead = mean_seconds_ > 0 ? threads * kAheadSeconds / mean_seconds_ : 0;
  const size_t wanted = threads + static_cast<size_t>(std::min<double>(ahead, most));
  return wanted > running_.size() ? static_cast<uint32_t>(wanted - running_.size()) : 0;
}

absl::Status Worker::sync_once() {
  v1::SyncRequest request;
  grpc::ClientContext context;
  {
    const std::lock_guard lock(mutex_);
    to_proto(options_.who, request.mutable_who());
    request.set_worker(options_.name);
    request.set_incarnation(incarnation_);
    request.set_sequence(++sequence_);
    request.set_seen(seen_);
    request.set_draining(draining_);
    for (const auto& [attempt, running] : running_) {
      if (running->lost) continue;
      auto* r = request.add_running();
      r->set_attempt(attempt);
      r->set_rays(running->rays);
    }
    for (const auto& [attempt, output] : finished_) {
      if (!output.ok()) {
        auto* f = request.add_failed();
        f->set_attempt(attempt);
        f->set_reason(std::string(output.status().message()));
        continue;
      }
      auto* f = request.add_finished();
      f->set_attempt(attempt);
      lightloom::to_proto(*output, f);
    }
    for (const std::string& attempt : released_) request.add_released(attempt);
    request.set_room(room());
    news_since_ = {};
    if (request.room() > 0 && !has_news()) {
      request.set_wait_ms(static_cast<uint32_t>((running_.empty() ? kIdleWait : kProgressEvery).count()));
      waiting_ = &context;
    }
  }
  context.set_deadline(std::chrono::system_clock::now() + kCallDeadline);
  v1::SyncResponse response;
  const grpc::Status status = v1::WorkerService::NewStub(channel_)->Sync(&context, request, &response);

  const std::lock_guard lock(mutex_);
  waiting_ = nullptr;
  if (!status.ok()) return from_grpc(status);
  synced_ = Clock::now();
  seen_ = response.sequence();
  hungry_ = static_cast<uint32_t>(response.assignments_size()) < request.room();
  for (const std::string& attempt : response.acknowledged()) {
    finished_.erase(attempt);
    std::erase(released_, attempt);
  }
  for (const std::string& attempt : response.lost()) lose(attempt);
  for (const std::string& payload : response.warm()) {
    // Nobody waits for it; what the server gives out goes before it.
    auto running = std::make_shared<Running>();
    running->task = {"warm", {payload.begin(), payload.end()}, {}, {}};
    running->lost = true;
    const std::string name = "warm " + std::to_string(++arrivals_);
    running_.emplace(name, std::move(running));
    queue_.emplace(std::pair(std::numeric_limits<int64_t>::max(), arrivals_), name);
  }
  for (const auto& a : response.assignments()) {
    if (running_.contains(a.attempt()) || finished_.contains(a.attempt())) continue;  // it came twice
    auto running = std::make_shared<Running>();
    running->task = to_task(a);
    running_.emplace(a.attempt(), std::move(running));
    queue_.emplace(std::pair(-int64_t{a.priority()}, ++arrivals_), a.attempt());
  }
  changed_.notify_all();
  return absl::OkStatus();
}

void Worker::lose(const std::string& attempt) {
  const auto at = running_.find(attempt);
  if (at == running_.end()) return;
  at->second->lost = true;
  at->second->cancel.cancel();
  if (std::erase_if(queue_, [&](const auto& q) { return q.second == attempt; }) > 0) running_.erase(at);
}

}  // namespace lightloom
