// The farm's one loop: a thread and a clock for the dispatcher, whose steps it makes durable together, and for those who
// watch.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "bake-server/coordinator/dispatcher.h"

namespace lightloom {

/// A job, and what is known of its progress only while this process runs.
struct JobStatus {
  Job job;
  uint64_t rays = 0;
  double rays_per_second = 0;
  uint32_t workers = 0;
};

struct CoordinatorOptions {
  uint32_t tick_ms = 100;   ///< how often leases and watchers are looked at
  bool keep_leases = true;  ///< of an earlier process on this state; false: its workers died with it
  DispatchOptions dispatch;
  AdmitJob check_submit;  ///< null: refuses none
};

/// Thread-safe. The store and the blobs must outlive it.
class Coordinator {
 public:
  /// Milliseconds that never run backwards, and are near Unix time for people.
  using Clock = std::function<int64_t()>;

  Coordinator(Store* store, BlobStore* blobs, Clock clock, CoordinatorOptions options);
  ~Coordinator();
  /// Syncs and watchers that wait are answered, and from now on all at once: Unavailable.
  void stop();

  using OnAnswer = Dispatcher::OnAnswer;
  /// `answer` is called once, later and from another thread: at once if there is something to say, else when there is, or
  /// when the worker's wait is over. Aborted: an old message, or one that a newer one overtook.
  void sync(SyncMessage message, OnAnswer answer);

  absl::StatusOr<JobStatus> submit(const NewJob& job);
  absl::StatusOr<JobStatus> cancel(JobId job);
  absl::StatusOr<JobStatus> set_priority(JobId job, int32_t priority);
  absl::StatusOr<JobStatus> job(JobId id);
  absl::StatusOr<std::vector<JobStatus>> jobs(JobId after, uint32_t limit);
  absl::StatusOr<std::vector<Event>> events(JobId job, int64_t after, uint32_t limit) {
    return store_->events(job, after, limit);
  }
  absl::StatusOr<Task> task(TaskId id) { return store_->task(id); }
  std::vector<WorkerStatus> workers();

  /// Calls back with the job whenever it changed, from another thread; an error ends it. `changed` returns false to be
  /// called no more; `over` says that nobody listens any more. Both may be called after the watcher has gone.
  using OnChange = std::function<bool(const absl::StatusOr<JobStatus>&)>;
  void watch(JobId job, uint64_t after_revision, OnChange changed, std::function<bool()> over);

 private:
  struct Watch {
    JobId job = 0;
    uint64_t revision = 0, rays = 0;
    OnChange changed;
    std::function<bool()> over;
  };

  void loop();
  void wake();
  void warn(const char* what, const absl::Status& status);
  void tell(std::vector<Watch>* watches);
  JobStatus status_of(Job job);

  Store* store_;
  Clock clock_;
  const CoordinatorOptions options_;
  BlobStore* blobs_;

  std::mutex dispatching_;  // guards the dispatcher; never taken while mutex_ is held
  Dispatcher dispatcher_;

  std::mutex mutex_;  // guards all below, but for what the loop's thread has taken
  std::condition_variable wake_;
  bool stop_ = false, work_ = false, news_ = false;
  std::vector<std::pair<SyncMessage, OnAnswer>> inbox_;
  std::vector<Watch> watches_;
  int64_t told_ms_ = 0;  // the loop's
  std::thread thread_;
};

}  // namespace lightloom
