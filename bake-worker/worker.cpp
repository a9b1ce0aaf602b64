#include "bake-worker/worker.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <random>

#include "bake-worker/task_messages.h"
#include "bake-worker/tasks_blob.h"
#include "proto/client.h"
#include "proto/worker_service.grpc.pb.h"

namespace lightloom {
namespace {

constexpr std::chrono::milliseconds kProgressEvery{1000}, kIdleWait{10'000}, kCallDeadline{20'000}, kRetry{500};
/// So long news wait for more, while there is work in hand.
constexpr std::chrono::milliseconds kTogether{100};
/// Work that is kept in hand for each thread, seconds; at most as many tasks as are begun at once.
constexpr double kAheadSeconds = 0.25;

/// So many tasks that fail one after the other say more about the worker than about themselves.
constexpr int kManyFailures = 10;

/// More than threads: some wait for the network.
uint32_t begun_at_once(uint32_t threads) { return threads + 1 + threads / 8; }

/// Of the server's disk.
bool is_no_room(const absl::Status& status) { return absl::IsResourceExhausted(status) && !is_out_of_memory(status); }

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
  stop_locked();
}

void Worker::stop_locked() {
  drain_locked();
  stopping_ = true;
  for (auto& [attempt, running] : running_) running->cancel.cancel();
}

/// There may be something to say.
void Worker::tell() {
  if (has_news() && news_since_ == Clock::time_point()) news_since_ = Clock::now();
  if (waiting_ != nullptr) {
    waiting_->TryCancel();
    interrupted_ = true;
  }
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
  absl::Status health = output.ok() ? absl::OkStatus() : executor_.health();
  Report report = report_of(std::move(output), running->cancel);
  const bool full = !options_.wait_for_room && is_no_room(report.output.status());
  if (full) health = report.output.status();

  std::unique_lock lock(mutex_);
  std::string trouble;
  if (!health.ok() && health_.ok()) {
    health_ = health;
    full ? stop_locked() : drain_locked();  // what the others make would find no room either
  }
  if (running->lost) {
    hungry_ = true;
  } else if (absl::IsCancelled(report.output.status()) || !health.ok()) {
    released_.push_back(attempt);
  } else {
    if (report.output.ok()) {
      mean_seconds_ = mean_seconds_ > 0 ? (mean_seconds_ + seconds) / 2 : seconds;
      failed_in_row_ = 0;
    } else if (++failed_in_row_ == kManyFailures) {
      trouble = std::to_string(kManyFailures) +
                " tasks in a row failed here, the last one: " + std::string(report.output.status().message());
    }
    finished_.emplace(attempt, std::move(report));
  }
  running_.erase(attempt);
  tell();
  lock.unlock();
  if (!trouble.empty()) options_.on_trouble(trouble);
}

/// What has to be uploaded for it is on the server.
Worker::Report Worker::report_of(absl::StatusOr<TaskOutput> output, const CancelFlag& cancel) {
  if (!output.ok()) return {std::move(output), std::nullopt};
  auto blob = upload_if_long(channel_, output->spawned, cancel, options_.wait_for_room);
  if (!blob.ok()) return {cancel.cancelled() ? absl::CancelledError("cancelled") : blob.status(), std::nullopt};
  if (*blob) output->spawned.clear();
  return {std::move(output), *blob};
}

/// The server will not hear of this worker, however often it asks, or need not be asked again.
bool Worker::is_final(const absl::Status& status) const {
  // A server that is stopping answers as if it had no such call.
  const bool known = synced_ != Clock::time_point();
  return absl::IsFailedPrecondition(status) || absl::IsInvalidArgument(status) ||
         (absl::IsUnimplemented(status) && !known) || (is_no_room(status) && !options_.wait_for_room);
}

absl::Status Worker::run() {
  for (;;) {
    const absl::Status status = sync_once();
    if (is_final(status)) return status;
    note(status);
    std::unique_lock lock(mutex_);
    if (draining_ && running_.empty() && !has_news()) return health_;
    if (stopping_ && !status.ok()) return health_;  // nobody hears what is handed back: its lease ends
    if (absl::IsCancelled(status) && interrupted_) continue;
    if (status.ok()) {
      for (auto at = next_sync(); Clock::now() < at; at = next_sync()) changed_.wait_until(lock, at);
    } else {
      changed_.wait_for(lock, kRetry, [&] { return stopping_; });
    }
  }
}

/// Tells of Syncs that begin to fail, and of those that work again.
void Worker::note(const absl::Status& sync) {
  if (absl::IsAborted(sync) || absl::IsCancelled(sync)) return;  // overtaken, or ended by news
  if (sync.ok()) {
    if (!troubles_.empty()) options_.on_trouble("the server answers again");
    troubles_.clear();
    return;
  }
  const bool away = absl::IsDeadlineExceeded(sync) || absl::IsUnimplemented(sync);
  if (troubles_.insert(away ? absl::StatusCode::kUnavailable : sync.code()).second) {
    options_.on_trouble("the server takes no Syncs, asking again until it does: " + std::string(sync.message()));
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
  const auto in_hand = static_cast<size_t>(
      std::count_if(running_.begin(), running_.end(), [](const auto& running) { return !running.second->warm; }));
  return wanted > in_hand ? static_cast<uint32_t>(wanted - in_hand) : 0;
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
    for (const auto& [attempt, report] : finished_) {
      if (!report.output.ok()) {
        auto* f = request.add_failed();
        f->set_attempt(attempt);
        f->set_reason(std::string(report.output.status().message()));
        continue;
      }
      auto* f = request.add_finished();
      f->set_attempt(attempt);
      lightloom::to_proto(*report.output, f);
      if (report.tasks_blob) f->set_tasks_blob(to_bytes(*report.tasks_blob));
    }
    for (const std::string& attempt : released_) request.add_released(attempt);
    request.set_room(room());
    news_since_ = {};
    interrupted_ = false;
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
  for (const std::string& payload : response.warm()) take_warm_up(payload);
  for (const auto& a : response.assignments()) {
    if (has(a.attempt())) continue;  // it came twice
    if (draining_) {                 // since the Sync was sent
      released_.push_back(a.attempt());
      continue;
    }
    auto running = std::make_shared<Running>();
    running->task = to_task(a);
    cancel_warm_ups_for(running->task);
    running_.emplace(a.attempt(), std::move(running));
    queue_.emplace(std::pair(-int64_t{a.priority()}, ++arrivals_), a.attempt());
  }
  tell();
  return absl::OkStatus();
}

bool Worker::has(const std::string& attempt) const {
  return running_.contains(attempt) || finished_.contains(attempt) ||
         std::find(released_.begin(), released_.end(), attempt) != released_.end();
}

/// Nobody waits for it; what the server gives out goes before it. One level at a time.
void Worker::take_warm_up(const std::string& payload) {
  if (draining_) return;
  if (std::any_of(running_.begin(), running_.end(), [](const auto& running) { return running.second->warm; })) return;
  auto running = std::make_shared<Running>();
  running->task = {"warm", {payload.begin(), payload.end()}, {}, {}};
  running->lost = running->warm = true;
  const std::string name = "warm " + std::to_string(++arrivals_);
  running_.emplace(name, std::move(running));
  queue_.emplace(std::pair(std::numeric_limits<int64_t>::max(), arrivals_), name);
}

/// Those of other levels: real work must not wait for them.
void Worker::cancel_warm_ups_for(const BakeTask& task) {
  std::vector<std::string> others;
  for (const auto& [name, running] : running_) {
    if (running->warm && running->task.payload != task.payload) others.push_back(name);
  }
  for (const std::string& name : others) lose(name);
}

void Worker::lose(const std::string& attempt) {
  const auto at = running_.find(attempt);
  if (at == running_.end()) return;
  at->second->lost = true;
  at->second->cancel.cancel();
  if (std::erase_if(queue_, [&](const auto& q) { return q.second == attempt; }) > 0) running_.erase(at);
}

}  // namespace lightloom
