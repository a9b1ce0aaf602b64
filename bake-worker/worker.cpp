#include "bake-worker/worker.h"

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <chrono>
#include <random>

#include "proto/client.h"
#include "proto/digest.h"
#include "proto/worker_service.grpc.pb.h"

namespace lightloom {
namespace {

constexpr std::chrono::milliseconds kProgressEvery{1000}, kIdleWait{10'000}, kCallDeadline{20'000}, kRetry{500};

class RemoteBlobs final : public BlobAccess {
 public:
  explicit RemoteBlobs(std::shared_ptr<grpc::Channel> channel) : client_(std::move(channel), patience()) {}
  absl::StatusOr<std::vector<uint8_t>> get(const Digest& digest) override { return client_.download(digest); }
  absl::StatusOr<Digest> put(std::span<const uint8_t> bytes) override { return client_.upload(bytes); }

 private:
  /// A server that restarts should not cost the work of minutes.
  static Patience patience() {
    Patience p;
    p.total = std::chrono::minutes(10);
    p.call = std::chrono::seconds(60);
    return p;
  }
  BlobClient client_;
};

}  // namespace

std::unique_ptr<BlobAccess> remote_blobs(std::shared_ptr<grpc::Channel> channel) {
  return std::make_unique<RemoteBlobs>(std::move(channel));
}

Worker::Worker(std::shared_ptr<grpc::Channel> channel, WorkerOptions options)
    : channel_(std::move(channel)),
      options_(std::move(options)),
      blobs_(remote_blobs(channel_)),
      runner_(blobs_.get(), options_.sessions) {
  if (options_.session != nullptr) runner_.adopt(options_.payload, options_.session);
  std::random_device random;
  incarnation_ = uint64_t{random()} << 32 | random() | 1;
  for (uint32_t i = 0; i < options_.who.threads; ++i) threads_.emplace_back([this] { execute(); });
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
  draining_ = true;
  for (const std::string& attempt : queue_) {
    running_.erase(attempt);
    released_.push_back(attempt);
  }
  queue_.clear();
  if (waiting_ != nullptr) waiting_->TryCancel();
  changed_.notify_all();
}

void Worker::stop() {
  drain();
  const std::lock_guard lock(mutex_);
  stopping_ = true;
  for (auto& [attempt, running] : running_) running->cancel.cancel();
  if (waiting_ != nullptr) waiting_->TryCancel();
  changed_.notify_all();
}

void Worker::execute() {
  std::unique_lock lock(mutex_);
  for (;;) {
    changed_.wait(lock, [&] { return ended_ || !queue_.empty(); });
    if (ended_) return;
    const std::string attempt = queue_.front();
    queue_.pop_front();
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
  absl::StatusOr<TaskOutput> output = absl::CancelledError("cancelled");
  if (!running->cancel.cancelled()) output = runner_.run(running->task, control);

  const std::lock_guard lock(mutex_);
  if (running->lost) {
    // Nobody waits for it.
  } else if (absl::IsCancelled(output.status())) {
    released_.push_back(attempt);
  } else {
    finished_.emplace(attempt, std::move(output));
  }
  running_.erase(attempt);
  if (waiting_ != nullptr) waiting_->TryCancel();
  changed_.notify_all();
}

absl::Status Worker::run() {
  for (;;) {
    bool idle = false;
    const absl::Status status = sync_once(&idle);
    if (absl::IsFailedPrecondition(status) || absl::IsInvalidArgument(status) || absl::IsUnimplemented(status)) {
      return status;
    }
    std::unique_lock lock(mutex_);
    const bool empty = running_.empty() && finished_.empty() && released_.empty();
    if (draining_ && empty) return absl::OkStatus();
    if (stopping_ && !status.ok()) return absl::OkStatus();  // nobody hears what is handed back: its lease ends
    const auto news = [&] { return !finished_.empty() || !released_.empty() || (draining_ && empty); };
    if (status.ok()) {
      if (!idle) changed_.wait_for(lock, kProgressEvery, news);
    } else if (!absl::IsAborted(status) && !absl::IsCancelled(status)) {
      changed_.wait_for(lock, kRetry, [&] { return stopping_; });
    }
  }
}

/// `idle`: there is room, so the next Sync may wait on the server for work.
absl::Status Worker::sync_once(bool* idle) {
  v1::SyncRequest request;
  grpc::ClientContext context;
  {
    const std::lock_guard lock(mutex_);
    auto* who = request.mutable_who();
    who->set_version(options_.who.version);
    who->set_protocol_version(options_.who.protocol_version);
    who->set_method_version(options_.who.method_version);
    who->set_avx2(options_.who.avx2);
    who->set_threads(options_.who.threads);
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
      f->set_rays(output->rays);
      for (const Digest& d : output->outputs) f->add_outputs(to_bytes(d));
      for (const SpawnedTask& s : output->spawned) {
        auto* t = f->add_tasks();
        t->set_kind(s.kind);
        t->set_stage(s.stage);
        t->set_argument(s.argument.data(), s.argument.size());
        t->set_order(s.order);
      }
    }
    for (const std::string& attempt : released_) request.add_released(attempt);
    const size_t busy = running_.size();
    const uint32_t room =
        draining_ || busy >= options_.who.threads ? 0 : options_.who.threads - static_cast<uint32_t>(busy);
    request.set_room(room);
    const bool news = !finished_.empty() || !released_.empty();
    *idle = room > 0;
    if (room > 0 && !news) {
      request.set_wait_ms(static_cast<uint32_t>((busy == 0 ? kIdleWait : kProgressEvery).count()));
      waiting_ = &context;
    }
  }
  context.set_deadline(std::chrono::system_clock::now() + kCallDeadline);
  v1::SyncResponse response;
  const grpc::Status status = v1::WorkerService::NewStub(channel_)->Sync(&context, request, &response);

  const std::lock_guard lock(mutex_);
  waiting_ = nullptr;
  if (!status.ok()) return from_grpc(status);
  seen_ = response.sequence();
  for (const std::string& attempt : response.acknowledged()) {
    finished_.erase(attempt);
    std::erase(released_, attempt);
  }
  for (const std::string& attempt : response.lost()) {
    const auto at = running_.find(attempt);
    if (at == running_.end()) continue;
    at->second->lost = true;
    at->second->cancel.cancel();
  }
  for (const auto& a : response.assignments()) {
    if (running_.contains(a.attempt()) || finished_.contains(a.attempt())) continue;  // it came twice
    auto running = std::make_shared<Running>();
    running->task.kind = a.kind();
    running->task.payload.assign(a.payload().begin(), a.payload().end());
    running->task.argument.assign(a.argument().begin(), a.argument().end());
    if (const auto inputs = to_digest(a.inputs()); inputs.ok()) running->task.inputs = *inputs;
    running_.emplace(a.attempt(), std::move(running));
    queue_.push_back(a.attempt());
  }
  changed_.notify_all();
  return absl::OkStatus();
}

}  // namespace lightloom
