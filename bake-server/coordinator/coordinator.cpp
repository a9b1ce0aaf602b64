#include "bake-server/coordinator/coordinator.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <utility>

namespace lightloom {
namespace {

constexpr int64_t kTellEveryMs = 50;  // watchers

absl::Status stopping() { return absl::UnavailableError("the server is stopping; try again when it is back"); }

}  // namespace

Coordinator::Coordinator(Store* store, BlobStore* blobs, Clock clock, CoordinatorOptions options)
    : store_(store),
      clock_(std::move(clock)),
      options_(std::move(options)),
      blobs_(blobs),
      dispatcher_(store, blobs, options_.dispatch) {
  if (options_.keep_leases) {
    // Workers could not say that they are alive while nobody listened.
    warn("renew leases", store_->renew_all(clock_() + options_.dispatch.lease_ms));
  } else {
    warn("end old leases", store_->expire(std::numeric_limits<int64_t>::max()).status());
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

void Coordinator::wake() {
  const std::lock_guard lock(mutex_);
  work_ = true;
  wake_.notify_all();
}

/// Nothing is lost by an error of the loop: it tries again with the next turn. But somebody should know.
void Coordinator::warn(const char* what, const absl::Status& status) {
  if (!status.ok()) spdlog::warn(absl::StrCat("cannot ", what, ": ", status.message()));
}

void Coordinator::sync(SyncMessage message, OnAnswer answer) {
  {
    const std::lock_guard lock(mutex_);
    if (!stop_) {
      inbox_.emplace_back(std::move(message), std::move(answer));
      wake_.notify_all();
      return;
    }
  }
  answer(stopping());
}

void Coordinator::loop() {
  std::unique_lock lock(mutex_);
  std::string last_error;
  while (!stop_) {
    if (inbox_.empty() && !work_) wake_.wait_for(lock, std::chrono::milliseconds(options_.tick_ms));
    work_ = false;
    auto inbox = std::exchange(inbox_, {});
    const bool news = std::exchange(news_, false);
    auto watches = std::exchange(watches_, {});
    lock.unlock();

    // What came in meanwhile is made durable together; nobody hears of it before.
    std::vector<Dispatcher::Answered> answers;
    {
      const std::lock_guard dispatching(dispatching_);
      if (news) dispatcher_.wake_all();
      const absl::Status durable = store_->group([&] {
        for (auto& [message, to] : inbox) dispatcher_.hear(std::move(message), std::move(to), clock_());
        answers = dispatcher_.step(clock_());
        return absl::OkStatus();
      });
      if (!durable.ok()) {
        for (auto& a : answers) a.answer = durable;
        for (auto& a : dispatcher_.give_up(durable)) answers.push_back(std::move(a));
        if (last_error != durable.message()) warn("record what workers say", durable);
      }
      last_error = std::string(durable.message());
    }
    for (auto& a : answers) a.to(std::move(a.answer));
    tell(&watches);

    lock.lock();
    for (Watch& w : watches) watches_.push_back(std::move(w));
  }
  auto inbox = std::exchange(inbox_, {});
  auto watches = std::exchange(watches_, {});
  lock.unlock();
  for (auto& [message, to] : inbox) to(stopping());
  std::vector<Dispatcher::Answered> answers;
  {
    const std::lock_guard dispatching(dispatching_);  // calls that read it may still come in
    answers = dispatcher_.give_up(stopping());
  }
  for (auto& a : answers) a.to(std::move(a.answer));
  for (Watch& w : watches) w.changed(stopping());
}

JobStatus Coordinator::status_of(Job job) {
  const std::lock_guard lock(dispatching_);
  JobStatus out;
  out.rays = dispatcher_.rays().total(job.id);
  out.rays_per_second = job.state == JobState::kRunning ? dispatcher_.rays().per_second(job.id) : 0;
  out.workers = dispatcher_.workers_of(job.id);
  out.job = std::move(job);
  return out;
}

/// Keeps those that want to hear more.
void Coordinator::tell(std::vector<Watch>* watches) {
  if (clock_() - told_ms_ < kTellEveryMs) return;
  told_ms_ = clock_();
  std::erase_if(*watches, [](const Watch& w) { return w.over(); });
  for (Watch& w : *watches) {
    auto job = store_->job(w.job);
    if (!job.ok()) {
      w.changed(job.status());
      w.changed = nullptr;
      continue;
    }
    const JobStatus status = status_of(*std::move(job));
    if (status.job.revision <= w.revision && status.rays == w.rays) continue;
    w.revision = status.job.revision;
    w.rays = status.rays;
    if (!w.changed(status)) w.changed = nullptr;
  }
  std::erase_if(*watches, [](const Watch& w) { return w.changed == nullptr; });
}

absl::StatusOr<JobStatus> Coordinator::submit(const NewJob& new_job) {
  for (const Digest& input : new_job.inputs) {
    if (!blobs_->has(input)) return absl::NotFoundError("blob " + input.hex() + " is not here; upload it first");
  }
  LL_ASSIGN_OR_RETURN(Job job, store_->submit(new_job, clock_(), options_.check_submit));
  wake();
  return status_of(std::move(job));
}

absl::StatusOr<JobStatus> Coordinator::cancel(JobId id) {
  LL_RETURN_IF_ERROR(store_->cancel(id, clock_()));
  {
    // Workers that wait are answered at once, so that they ask again, and hear what is lost to them.
    const std::lock_guard lock(mutex_);
    news_ = true;
  }
  wake();
  return job(id);
}

absl::StatusOr<JobStatus> Coordinator::set_priority(JobId id, int32_t priority) {
  LL_RETURN_IF_ERROR(store_->set_priority(id, priority));
  wake();
  return job(id);
}

absl::StatusOr<JobStatus> Coordinator::job(JobId id) {
  LL_ASSIGN_OR_RETURN(Job job, store_->job(id));
  return status_of(std::move(job));
}

absl::StatusOr<std::vector<JobStatus>> Coordinator::jobs(JobId after, uint32_t limit) {
  LL_ASSIGN_OR_RETURN(std::vector<Job> jobs, store_->jobs(after, limit));
  std::vector<JobStatus> out;
  for (Job& job : jobs) out.push_back(status_of(std::move(job)));
  return out;
}

std::vector<WorkerStatus> Coordinator::workers() {
  const std::lock_guard lock(dispatching_);
  return dispatcher_.workers(clock_());
}

void Coordinator::watch(JobId job, uint64_t after_revision, OnChange changed, std::function<bool()> over) {
  {
    const std::lock_guard lock(mutex_);
    if (!stop_) {
      watches_.push_back({job, after_revision, 0, std::move(changed), std::move(over)});
      work_ = true;
      wake_.notify_all();
      return;
    }
  }
  changed(stopping());
}

}  // namespace lightloom
