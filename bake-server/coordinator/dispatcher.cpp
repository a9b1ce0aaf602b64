#include "bake-server/coordinator/dispatcher.h"

#include <algorithm>
#include <utility>

#include "core/bake/task_list.h"

namespace lightloom {
namespace {

constexpr uint32_t kReadyPerJob = 256;        // tasks of a job that are looked at when some are given out
constexpr int64_t kForgetWorkerMs = 600'000;  // that has said nothing for so long
constexpr uint32_t kMaxLive = 2;              // attempts at a task: one, and one more if it takes long
constexpr uint32_t kSuspect = 3;              // tasks in a row that a worker failed: what others failed is not for it

SyncFacts facts_of(const SyncMessage& message) {
  SyncFacts facts{message.incarnation, message.sequence, message.seen, {}};
  for (const auto& r : message.running) facts.has.insert(r.attempt);
  for (const auto& f : message.finished) facts.has.insert(f.attempt);
  for (const auto& f : message.failed) facts.has.insert(f.attempt);
  for (const auto& r : message.released) facts.has.insert(r);
  return facts;
}

}  // namespace

void Dispatcher::hear(SyncMessage message, OnAnswer to, int64_t now_ms) {
  Worker& worker = workers_[message.worker];
  const SyncOutcome outcome = worker.session.sync(facts_of(message));
  if (outcome.replaced) {
    // If its sender still lives, two of one name would take each other's tasks away without end.
    answered_.push_back({std::move(to), absl::FailedPreconditionError("another process works here under the name '" +
                                                                      message.worker + "'; give each its own --name")});
    return;
  }
  if (outcome.stale) {
    answered_.push_back({std::move(to), absl::AbortedError("a newer Sync of worker " + message.worker + " is here")});
    return;
  }
  for (Pending& p : pending_) {
    if (p.worker != message.worker) continue;
    answered_.push_back({std::move(p.to), absl::AbortedError("a newer Sync of this worker is here")});
  }
  std::erase_if(pending_, [&](const Pending& p) { return p.worker == message.worker; });

  worker.version = message.version;
  worker.threads = message.threads;
  worker.draining = message.draining;
  worker.heard_ms = now_ms;
  Pending pending;
  pending.worker = message.worker;
  pending.room = message.room;
  pending.until_ms = now_ms + message.wait_ms;
  pending.answer.lease_ms = options_.lease_ms;
  pending.to = std::move(to);

  absl::Status status = store_->release(message.worker, outcome.gone, now_ms);
  for (const std::string& attempt : outcome.gone) worker.held.erase(attempt);
  if (status.ok()) status = record(message, &worker, &pending.answer, now_ms);
  if (status.ok()) status = resend(outcome.resend, &worker, &pending, now_ms);
  if (!status.ok()) {
    answered_.push_back({std::move(pending.to), status});
    return;
  }
  pending.urgent =
      !pending.answer.acknowledged.empty() || !pending.answer.lost.empty() || !pending.answer.assignments.empty();
  pending_.push_back(std::move(pending));
}

/// Puts on record what the worker did.
absl::Status Dispatcher::record(const SyncMessage& message, Worker* worker, SyncAnswer* answer, int64_t now_ms) {
  const auto acknowledge = [&](const std::string& attempt) {
    answer->acknowledged.push_back(attempt);
    forget(attempt, worker);
  };
  const auto fail = [&](const std::string& attempt, const std::string& reason) -> absl::Status {
    LL_ASSIGN_OR_RETURN(const bool failed, store_->fail(attempt, reason, now_ms, options_.max_failures));
    worker->failed_in_row += failed;
    return absl::OkStatus();
  };
  for (const auto& f : message.finished) {
    const absl::Status there = blobs_->require(f.outputs);
    const auto completion =
        there.ok() ? store_->complete(f.attempt, f.outputs, f.tasks, now_ms) : absl::StatusOr<Completion>(there);
    if (absl::IsInvalidArgument(completion.status())) {
      LL_RETURN_IF_ERROR(fail(f.attempt, std::string(completion.status().message())));
    } else if (!completion.ok()) {
      return completion.status();
    } else {
      const auto held = worker->held.find(f.attempt);
      if (*completion == Completion::kAccepted && held != worker->held.end()) rays_.add(held->second.job, f.rays);
      worker->failed_in_row = 0;
    }
    acknowledge(f.attempt);
  }
  for (const auto& f : message.failed) {
    LL_RETURN_IF_ERROR(fail(f.attempt, f.reason));
    acknowledge(f.attempt);
  }
  LL_RETURN_IF_ERROR(store_->release(message.worker, message.released, now_ms));
  for (const std::string& attempt : message.released) acknowledge(attempt);

  std::vector<std::string> running;
  for (const auto& r : message.running) {
    running.push_back(r.attempt);
    if (const auto held = worker->held.find(r.attempt); held != worker->held.end()) held->second.rays = r.rays;
  }
  LL_ASSIGN_OR_RETURN(std::vector<std::string> kept,
                      store_->extend(message.worker, running, now_ms + options_.lease_ms));
  std::sort(kept.begin(), kept.end());
  for (const std::string& attempt : running) {
    if (std::binary_search(kept.begin(), kept.end(), attempt)) continue;
    answer->lost.push_back(attempt);
    forget(attempt, worker);
  }
  return absl::OkStatus();
}

/// Assignments that may not have arrived.
absl::Status Dispatcher::resend(const std::vector<std::string>& attempts, Worker* worker, Pending* pending,
                                int64_t now_ms) {
  LL_ASSIGN_OR_RETURN(const std::vector<std::string> kept,
                      store_->extend(pending->worker, attempts, now_ms + options_.lease_ms));
  for (const std::string& attempt : attempts) {
    const auto held = worker->held.find(attempt);
    if (held == worker->held.end() || std::find(kept.begin(), kept.end(), attempt) == kept.end()) {
      forget(attempt, worker);
      continue;
    }
    LL_ASSIGN_OR_RETURN(const Job job, store_->job(held->second.job));
    LL_ASSIGN_OR_RETURN(Assignment again, assignment(held->second.task, attempt, job.priority));
    pending->answer.assignments.push_back(std::move(again));
    if (pending->room > 0) --pending->room;
  }
  return absl::OkStatus();
}

void Dispatcher::forget(const std::string& attempt, Worker* worker) {
  worker->session.forget(attempt);
  worker->held.erase(attempt);
}

std::vector<Dispatcher::Answered> Dispatcher::step(int64_t now_ms) {
  const auto expired = store_->expire(now_ms);
  if (expired.ok()) {
    for (const std::string& attempt : *expired) {
      for (auto& [id, worker] : workers_) worker.held.erase(attempt);
    }
  }
  absl::Status status = expired.status();
  if (status.ok()) status = give_out(now_ms);
  if (!status.ok()) return give_up(status);

  std::map<JobId, uint64_t> running;
  for (const auto& [id, worker] : workers_) {
    for (const auto& [attempt, held] : worker.held) running[held.job] += held.rays;
  }
  rays_.measure(running, now_ms);
  std::erase_if(workers_, [&](const auto& w) { return now_ms - w.second.heard_ms > kForgetWorkerMs; });
  return take_due(now_ms);
}

absl::Status Dispatcher::give_out(int64_t now_ms) {
  std::vector<Demand> demands;
  for (const Pending& p : pending_) {
    const Worker& w = workers_[p.worker];
    if (w.draining) continue;
    Demand demand{p.worker, p.room, w.last_job, w.last_order, w.threads};
    for (const auto& [attempt, held] : w.held) demand.held.push_back(held.job);
    demands.push_back(std::move(demand));
  }
  if (demands.empty() || (options_.paused && options_.paused())) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(std::vector<JobView> view, store_->view(kReadyPerJob));
  const auto runs = [&](JobId id) {
    return std::any_of(view.begin(), view.end(), [&](const JobView& job) { return job.id == id; });
  };
  std::erase_if(inputs_, [&](const auto& list) { return !runs(list.first.first); });
  std::erase_if(payloads_, [&](const auto& payload) { return !runs(payload.first); });
  std::map<JobId, int32_t> priorities;
  for (const JobView& job : view) priorities[job.id] = job.priority;
  for (auto& [id, worker] : workers_) std::erase_if(worker.warmed, [&](JobId job) { return !runs(job); });
  std::vector<JobId> waiting;  // jobs of which nothing is left to give out now
  for (const JobView& job : view) {
    if (job.ready.empty() && job.live > 0) waiting.push_back(job.id);
  }
  std::vector<std::string> present;
  std::set<std::string> suspects;
  for (const auto& [id, worker] : workers_) {
    if (!worker.draining && now_ms - worker.heard_ms <= options_.lease_ms) present.push_back(id);
    if (worker.failed_in_row >= kSuspect) suspects.insert(id);
  }
  for (const Decision& d : decide(std::move(view), std::move(demands), now_ms, options_.decide, present, suspects)) {
    const NewLease lease{d.task, d.worker, options_.new_token(), now_ms + options_.lease_ms, kMaxLive};
    // First, so that nothing is leased that cannot be told.
    LL_ASSIGN_OR_RETURN(Assignment assigned, assignment(d.task, lease.token, priorities.at(d.job)));
    LL_ASSIGN_OR_RETURN(const bool leased, store_->lease(lease, now_ms));
    if (!leased) continue;  // somebody else was faster: look again with the next step
    Worker& worker = workers_[d.worker];
    worker.last_job = d.job;
    worker.last_order = d.order;
    worker.held[lease.token] = {d.job, d.task, 0};
    const auto to =
        std::find_if(pending_.begin(), pending_.end(), [&](const Pending& p) { return p.worker == d.worker; });
    to->answer.assignments.push_back(std::move(assigned));
    if (to->room > 0) --to->room;
    to->urgent = true;
  }
  return warm_up(waiting);
}

/// A job's first task asks for all others, and takes as long as it takes to plan the level: those that have nothing to do
/// meanwhile plan it too, as each of them has to.
absl::Status Dispatcher::warm_up(const std::vector<JobId>& jobs) {
  for (Pending& p : pending_) {
    Worker& worker = workers_[p.worker];
    if (p.room == 0 || worker.draining || !worker.held.empty()) continue;
    for (const JobId id : jobs) {
      if (worker.warmed.contains(id)) continue;
      LL_ASSIGN_OR_RETURN(const Job job, store_->job(id));
      worker.warmed.insert(id);
      if (job.done > 0) continue;
      p.answer.warm.push_back(job.payload);
      p.urgent = true;
      break;  // one level at a time
    }
  }
  return absl::OkStatus();
}

absl::StatusOr<Assignment> Dispatcher::assignment(TaskId id, const std::string& attempt, int32_t priority) {
  LL_ASSIGN_OR_RETURN(const Task task, store_->task(id));
  LL_ASSIGN_OR_RETURN(const std::optional<Digest> inputs, inputs_of(task));
  auto payload = payloads_.find(task.job);
  if (payload == payloads_.end()) {
    LL_ASSIGN_OR_RETURN(Job job, store_->job(task.job));
    payload = payloads_.emplace(task.job, std::move(job.payload)).first;
  }
  return Assignment{attempt, task.job, priority, payload->second, task.kind, task.argument, inputs};
}

/// A blob that lists what all stages below gave. They are done, so it does not change any more.
absl::StatusOr<std::optional<Digest>> Dispatcher::inputs_of(const Task& task) {
  if (task.stage == 0) return std::nullopt;
  const auto key = std::pair(task.job, task.stage);
  // No job names it, so it may have been collected as garbage meanwhile.
  if (const auto known = inputs_.find(key); known != inputs_.end() && blobs_->has(known->second)) return known->second;
  std::vector<FinishedTask> below;
  for (uint32_t stage = 0; stage < task.stage; ++stage) {
    LL_ASSIGN_OR_RETURN(const auto outputs, store_->outputs(task.job, stage));
    for (const TaskOutputs& o : outputs) below.push_back({o.kind, {o.argument.begin(), o.argument.end()}, o.outputs});
  }
  LL_ASSIGN_OR_RETURN(const Digest digest, blobs_->put(encode_task_list(below)));
  inputs_[key] = digest;
  return digest;
}

std::vector<Dispatcher::Answered> Dispatcher::take_due(int64_t now_ms) {
  for (Pending& p : pending_) {
    if (p.urgent || now_ms >= p.until_ms) answer(&p, absl::OkStatus());
  }
  std::erase_if(pending_, [](const Pending& p) { return p.to == nullptr; });
  return std::exchange(answered_, {});
}

std::vector<Dispatcher::Answered> Dispatcher::give_up(const absl::Status& status) {
  for (Pending& p : pending_) answer(&p, status);
  pending_.clear();
  return std::exchange(answered_, {});
}

/// Also an answer that ends as an error has a number: what it was to carry is then sent again.
void Dispatcher::answer(Pending* pending, const absl::Status& status) {
  WorkerSession& session = workers_[pending->worker].session;
  pending->answer.sequence = session.answer();
  for (const Assignment& a : pending->answer.assignments) session.assigned(a.attempt, pending->answer.sequence);
  auto to = std::exchange(pending->to, nullptr);
  if (status.ok()) {
    answered_.push_back({std::move(to), std::move(pending->answer)});
  } else {
    answered_.push_back({std::move(to), status});
  }
}

void Dispatcher::wake_all() {
  for (Pending& p : pending_) p.urgent = true;
}

std::vector<WorkerStatus> Dispatcher::workers(int64_t now_ms) const {
  std::vector<WorkerStatus> out;
  for (const auto& [id, w] : workers_) {
    out.push_back({id, w.version, w.threads, static_cast<uint32_t>(w.held.size()), now_ms - w.heard_ms, w.draining});
  }
  return out;
}

uint32_t Dispatcher::workers_of(JobId job) const {
  return static_cast<uint32_t>(std::count_if(workers_.begin(), workers_.end(), [&](const auto& w) {
    return std::any_of(w.second.held.begin(), w.second.held.end(),
                       [&](const auto& held) { return held.second.job == job; });
  }));
}

}  // namespace lightloom
