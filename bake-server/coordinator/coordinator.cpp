#include "bake-server/coordinator/coordinator.h"

#include <algorithm>
#include <chrono>
#include <limits>
#include <random>
#include <utility>

#include "core/bake/task_list.h"

namespace lightloom {
namespace {

constexpr uint32_t kReadyPerJob = 256;        // tasks of a job that are looked at when some are given out
constexpr int64_t kForgetWorkerMs = 600'000;  // that has said nothing for so long

absl::Status stopping() { return absl::UnavailableError("the server is stopping; try again when it is back"); }

}  // namespace

Coordinator::Clock steady_unix_clock() {
  using std::chrono::milliseconds;
  const auto began = std::chrono::steady_clock::now();
  const int64_t unix =
      std::chrono::duration_cast<milliseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
  return
      [=] { return unix + std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - began).count(); };
}

Coordinator::Coordinator(Store* store, BlobStore* blobs, Clock clock, CoordinatorOptions options)
    : store_(store), blobs_(blobs), clock_(std::move(clock)), options_(options) {
  if (options_.keep_leases) {
    // Workers could not say that they are alive while nobody listened.
    (void)store_->renew_all(clock_() + options_.lease_ms);
  } else {
    (void)store_->expire(std::numeric_limits<int64_t>::max());
  }
  thread_ = std::thread([this] { loop(); });
}

Coordinator::~Coordinator() {
  stop();
  thread_.join();
}

void Coordinator::stop() {
  const std::lock_guard lock(mutex_);
  stop_ = true;
  wake_.notify_all();
}

void Coordinator::sync(SyncMessage message, OnAnswer answer) {
  const std::lock_guard lock(mutex_);
  if (stop_) {
    answer(stopping());
    return;
  }
  inbox_.emplace_back(std::move(message), std::move(answer));
  wake_.notify_all();
}

void Coordinator::loop() {
  std::unique_lock lock(mutex_);
  while (!stop_) {
    if (inbox_.empty() && !work_) wake_.wait_for(lock, std::chrono::milliseconds(options_.tick_ms));
    work_ = false;
    for (auto& [message, done] : std::exchange(inbox_, {})) take(std::move(message), std::move(done));
    (void)store_->expire(clock_());
    if (const absl::Status status = give_out(); !status.ok()) {
      for (Pending& p : pending_) p.done(status);
      pending_.clear();
    }
    answer_due();
    measure_rays();
    tell_watchers();
    std::erase_if(workers_, [&](const auto& w) { return clock_() - w.second.heard_ms > kForgetWorkerMs; });
  }
  for (auto& [message, done] : inbox_) done(stopping());
  for (Pending& p : pending_) p.done(stopping());
  for (Watch& w : watches_) w.changed(stopping());
}

void Coordinator::take(SyncMessage message, OnAnswer done) {
  Worker& worker = workers_[message.worker];
  SyncFacts facts{message.incarnation, message.sequence, message.seen, {}};
  for (const auto& r : message.running) facts.has.insert(r.attempt);
  for (const auto& f : message.finished) facts.has.insert(f.attempt);
  for (const auto& f : message.failed) facts.has.insert(f.attempt);
  for (const auto& r : message.released) facts.has.insert(r);
  const SyncOutcome outcome = worker.session.sync(facts);
  if (outcome.stale) {
    done(absl::AbortedError("a newer Sync of worker " + message.worker + " is here"));
    return;
  }
  for (Pending& p : pending_) {
    if (p.worker == message.worker) p.done(absl::AbortedError("a newer Sync of this worker is here"));
  }
  std::erase_if(pending_, [&](const Pending& p) { return p.worker == message.worker; });

  worker.version = message.version;
  worker.threads = message.threads;
  worker.draining = message.draining;
  worker.heard_ms = clock_();
  Pending pending;
  pending.worker = message.worker;
  pending.room = message.draining ? 0 : message.room;
  pending.until_ms = clock_() + message.wait_ms;
  pending.answer.lease_ms = options_.lease_ms;
  pending.done = std::move(done);
  absl::Status status = store_->release(message.worker, outcome.gone);
  for (const std::string& attempt : outcome.gone) worker.attempts.erase(attempt);
  if (status.ok()) status = record(message, &worker, &pending.answer);
  // Assignments that may not have arrived are sent again.
  for (const std::string& attempt : outcome.resend) {
    if (!status.ok()) break;
    const auto held = store_->extend(message.worker, {attempt}, clock_() + options_.lease_ms);
    if (!held.ok()) status = held.status();
    const auto task = tasks_.find(attempt);
    if (!held.ok() || held->empty() || task == tasks_.end()) {
      worker.session.forget(attempt);
      worker.attempts.erase(attempt);
      continue;
    }
    auto again = assignment(task->second, attempt);
    if (!again.ok()) {
      status = again.status();
      break;
    }
    pending.answer.assignments.push_back(*std::move(again));
    if (pending.room > 0) --pending.room;
  }
  if (!status.ok()) {
    pending.done(status);
    return;
  }
  pending.urgent =
      !pending.answer.acknowledged.empty() || !pending.answer.lost.empty() || !pending.answer.assignments.empty();
  pending_.push_back(std::move(pending));
}

/// Puts on record what the worker did.
absl::Status Coordinator::record(const SyncMessage& message, Worker* worker, SyncAnswer* answer) {
  const auto acknowledge = [&](const std::string& attempt) {
    answer->acknowledged.push_back(attempt);
    worker->session.forget(attempt);
    worker->attempts.erase(attempt);
    tasks_.erase(attempt);
  };
  for (const auto& f : message.finished) {
    const auto at = worker->attempts.find(f.attempt);
    const auto completion = store_->complete(f.attempt, f.outputs, f.tasks, clock_());
    if (absl::IsInvalidArgument(completion.status())) {
      LL_RETURN_IF_ERROR(
          store_->fail(f.attempt, std::string(completion.status().message()), clock_(), options_.max_failures)
              .status());
    } else if (!completion.ok()) {
      return completion.status();
    } else if (*completion == Completion::kAccepted && at != worker->attempts.end()) {
      rays_[at->second.first].finished += f.rays;
    }
    acknowledge(f.attempt);
  }
  for (const auto& f : message.failed) {
    LL_RETURN_IF_ERROR(store_->fail(f.attempt, f.reason, clock_(), options_.max_failures).status());
    acknowledge(f.attempt);
  }
  LL_RETURN_IF_ERROR(store_->release(message.worker, message.released));
  for (const std::string& attempt : message.released) acknowledge(attempt);

  std::vector<std::string> running;
  for (const auto& r : message.running) {
    running.push_back(r.attempt);
    if (const auto at = worker->attempts.find(r.attempt); at != worker->attempts.end()) at->second.second = r.rays;
  }
  LL_ASSIGN_OR_RETURN(std::vector<std::string> held,
                      store_->extend(message.worker, running, clock_() + options_.lease_ms));
  std::sort(held.begin(), held.end());
  for (const std::string& attempt : running) {
    if (std::binary_search(held.begin(), held.end(), attempt)) continue;
    answer->lost.push_back(attempt);
    worker->session.forget(attempt);
    worker->attempts.erase(attempt);
    tasks_.erase(attempt);
  }
  return absl::OkStatus();
}

absl::Status Coordinator::give_out() {
  std::vector<Demand> demands;
  for (const Pending& p : pending_) {
    if (p.room == 0) continue;
    const Worker& w = workers_[p.worker];
    demands.push_back({p.worker, p.room, w.last_job, w.last_order});
  }
  if (demands.empty()) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(std::vector<JobView> view, store_->view(kReadyPerJob));
  for (const Decision& d : decide(std::move(view), std::move(demands), clock_(), options_.decide)) {
    const auto to =
        std::find_if(pending_.begin(), pending_.end(), [&](const Pending& p) { return p.worker == d.worker; });
    NewLease lease{d.task, d.worker, new_token(), clock_() + options_.lease_ms, 2};
    LL_ASSIGN_OR_RETURN(const bool leased, store_->lease(lease, clock_()));
    if (!leased) continue;  // it ended meanwhile: look again with the next tick
    Worker& worker = workers_[d.worker];
    worker.last_job = d.job;
    worker.last_order = d.order;
    worker.attempts[lease.token] = {d.job, 0};
    tasks_[lease.token] = d.task;
    LL_ASSIGN_OR_RETURN(Assignment assigned, assignment(d.task, lease.token));
    to->answer.assignments.push_back(std::move(assigned));
    --to->room;
    to->urgent = true;
  }
  return absl::OkStatus();
}

absl::StatusOr<Assignment> Coordinator::assignment(TaskId id, const std::string& attempt) {
  LL_ASSIGN_OR_RETURN(const Task task, store_->task(id));
  LL_ASSIGN_OR_RETURN(const Job job, store_->job(task.job));
  LL_ASSIGN_OR_RETURN(const std::optional<Digest> inputs, inputs_of(task));
  return Assignment{attempt, task.job, job.payload, task.kind, task.argument, inputs};
}

/// A blob that lists what all stages below gave. They are done, so it does not change any more.
absl::StatusOr<std::optional<Digest>> Coordinator::inputs_of(const Task& task) {
  if (task.stage == 0) return std::nullopt;
  const auto key = std::pair(task.job, task.stage);
  if (const auto known = inputs_.find(key); known != inputs_.end()) return known->second;
  std::vector<FinishedTask> below;
  for (uint32_t stage = 0; stage < task.stage; ++stage) {
    LL_ASSIGN_OR_RETURN(const auto outputs, store_->outputs(task.job, stage));
    for (const TaskOutputs& o : outputs) below.push_back({o.kind, {o.argument.begin(), o.argument.end()}, o.outputs});
  }
  LL_ASSIGN_OR_RETURN(const Digest digest, blobs_->put(encode_task_list(below)));
  inputs_[key] = digest;
  return digest;
}

void Coordinator::answer_due() {
  for (Pending& p : pending_) {
    if (!p.urgent && clock_() < p.until_ms) continue;
    Worker& worker = workers_[p.worker];
    p.answer.sequence = worker.session.answer();
    for (const Assignment& a : p.answer.assignments) worker.session.assigned(a.attempt, p.answer.sequence);
    p.done(std::move(p.answer));
    p.done = nullptr;
  }
  std::erase_if(pending_, [](const Pending& p) { return p.done == nullptr; });
}

void Coordinator::measure_rays() {
  const int64_t now = clock_();
  std::map<JobId, uint64_t> live;
  for (const auto& [id, worker] : workers_) {
    for (const auto& [attempt, of] : worker.attempts) live[of.first] += of.second;
  }
  for (auto& [job, rays] : rays_) live.try_emplace(job, 0);
  for (const auto& [job, running] : live) {
    Rays& rays = rays_[job];
    if (now - rays.last_ms < 1000) continue;
    const uint64_t total = rays.finished + running;
    const double rate =
        total > rays.last_total && rays.last_ms > 0
            ? 1e3 * static_cast<double>(total - rays.last_total) / static_cast<double>(now - rays.last_ms)
            : 0;
    rays.per_second += 0.3 * (rate - rays.per_second);
    rays.last_total = std::max(total, rays.last_total);
    rays.last_ms = now;
  }
}

JobStatus Coordinator::status_of(Job job) {
  JobStatus out;
  if (const auto rays = rays_.find(job.id); rays != rays_.end()) {
    out.rays = rays->second.finished;
    out.rays_per_second = job.state == JobState::kRunning ? rays->second.per_second : 0;
  }
  for (const auto& [id, worker] : workers_) {
    bool has = false;
    for (const auto& [attempt, of] : worker.attempts) {
      if (of.first != job.id) continue;
      has = true;
      out.rays += of.second;
    }
    out.workers += has;
  }
  out.job = std::move(job);
  return out;
}

void Coordinator::tell_watchers() {
  for (Watch& w : watches_) {
    const auto job = store_->job(w.job);
    if (!job.ok()) {
      w.changed(job.status());
      w.changed = nullptr;
      continue;
    }
    JobStatus status = status_of(*job);
    if (status.job.revision <= w.revision && status.rays == w.rays) continue;
    w.revision = status.job.revision;
    w.rays = status.rays;
    if (!w.changed(status)) w.changed = nullptr;
  }
  std::erase_if(watches_, [](const Watch& w) { return w.changed == nullptr; });
}

absl::StatusOr<JobStatus> Coordinator::submit(const NewJob& new_job) {
  for (const Digest& input : new_job.inputs) {
    if (!blobs_->has(input)) return absl::NotFoundError("blob " + input.hex() + " is not here; upload it first");
  }
  LL_ASSIGN_OR_RETURN(Job job, store_->submit(new_job, clock_()));
  const std::lock_guard lock(mutex_);
  work_ = true;
  wake_.notify_all();
  return status_of(std::move(job));
}

absl::StatusOr<JobStatus> Coordinator::cancel(JobId id) {
  LL_RETURN_IF_ERROR(store_->cancel(id, clock_()));
  {
    // Workers that wait are told at once; the others with their next Sync.
    const std::lock_guard lock(mutex_);
    for (Pending& p : pending_) p.urgent = true;
    work_ = true;
    wake_.notify_all();
  }
  return job(id);
}

absl::StatusOr<JobStatus> Coordinator::set_priority(JobId id, int32_t priority) {
  LL_RETURN_IF_ERROR(store_->set_priority(id, priority));
  return job(id);
}

absl::StatusOr<JobStatus> Coordinator::job(JobId id) {
  LL_ASSIGN_OR_RETURN(Job job, store_->job(id));
  const std::lock_guard lock(mutex_);
  return status_of(std::move(job));
}

absl::StatusOr<std::vector<JobStatus>> Coordinator::jobs(JobId after, uint32_t limit) {
  LL_ASSIGN_OR_RETURN(std::vector<Job> jobs, store_->jobs(after, limit));
  const std::lock_guard lock(mutex_);
  std::vector<JobStatus> out;
  for (Job& job : jobs) out.push_back(status_of(std::move(job)));
  return out;
}

std::vector<WorkerStatus> Coordinator::workers() {
  const std::lock_guard lock(mutex_);
  std::vector<WorkerStatus> out;
  for (const auto& [id, w] : workers_) {
    out.push_back(
        {id, w.version, w.threads, static_cast<uint32_t>(w.attempts.size()), clock_() - w.heard_ms, w.draining});
  }
  return out;
}

void Coordinator::watch(JobId job, uint64_t after_revision, OnChange changed) {
  const std::lock_guard lock(mutex_);
  if (stop_) {
    changed(stopping());
    return;
  }
  watches_.push_back({job, after_revision, 0, std::move(changed)});
  work_ = true;
  wake_.notify_all();
}

std::string Coordinator::new_token() {
  static constexpr char kHex[] = "0123456789abcdef";
  std::random_device random;
  std::string out;
  for (int i = 0; i < 4; ++i) {
    for (uint32_t bits = random(), k = 0; k < 8; ++k, bits >>= 4) out += kHex[bits & 15];
  }
  return out;
}

}  // namespace lightloom
