// The farm's one loop: hears workers, keeps leases, gives out tasks, tells who watches. It holds nothing that a restart
// would miss: what counts is in the store.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "bake-server/blobs/blob_store.h"
#include "bake-server/scheduler/decide.h"
#include "bake-server/scheduler/worker_session.h"
#include "bake-server/store/store.h"

namespace lightloom {

/// What a worker says in a Sync (proto/worker_service.proto). Checked against the limits there.
struct SyncMessage {
  std::string worker, version;
  uint32_t threads = 0;
  uint64_t incarnation = 0, sequence = 0, seen = 0;
  uint32_t room = 0, wait_ms = 0;
  bool draining = false;
  struct Running {
    std::string attempt;
    uint64_t rays = 0;
  };
  std::vector<Running> running;
  struct Finished {
    std::string attempt;
    std::vector<Digest> outputs;
    std::vector<NewTask> tasks;
    uint64_t rays = 0;
  };
  std::vector<Finished> finished;
  struct Failed {
    std::string attempt, reason;
  };
  std::vector<Failed> failed;
  std::vector<std::string> released;
};

struct Assignment {
  std::string attempt;
  JobId job = 0;
  std::string payload, kind, argument;
  std::optional<Digest> inputs;  ///< blob that lists what the stage below gave
};

struct SyncAnswer {
  uint64_t sequence = 0;
  std::vector<std::string> acknowledged, lost;
  std::vector<Assignment> assignments;
  uint32_t lease_ms = 0;
};

/// A job, and what is known of its progress only while this process runs.
struct JobStatus {
  Job job;
  uint64_t rays = 0;
  double rays_per_second = 0;
  uint32_t workers = 0;
};

struct WorkerStatus {
  std::string id, version;
  uint32_t threads = 0, running = 0;
  int64_t silent_ms = 0;
  bool draining = false;
};

struct CoordinatorOptions {
  uint32_t lease_ms = 30'000;
  uint32_t max_failures = 3;  ///< of a task, then it has failed for good
  uint32_t tick_ms = 100;     ///< how often leases and watchers are looked at
  bool keep_leases = true;    ///< of an earlier process on this state; false: its workers died with it
  DecideOptions decide;
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

  using OnAnswer = std::function<void(absl::StatusOr<SyncAnswer>)>;
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
  /// called no more.
  using OnChange = std::function<bool(const absl::StatusOr<JobStatus>&)>;
  void watch(JobId job, uint64_t after_revision, OnChange changed);

 private:
  struct Worker {
    WorkerSession session;
    std::string version;
    uint32_t threads = 0;
    bool draining = false;
    int64_t heard_ms = 0;
    std::map<std::string, std::pair<JobId, uint64_t>> attempts;  // what it runs, and the rays of each so far
    JobId last_job = 0;
    int64_t last_order = 0;
  };
  struct Pending {
    std::string worker;
    uint32_t room = 0;
    int64_t until_ms = 0;
    SyncAnswer answer;
    bool urgent = false;  // there is something to say
    OnAnswer done;
  };
  struct Rays {
    uint64_t finished = 0;
    double per_second = 0;
    uint64_t last_total = 0;
    int64_t last_ms = 0;
  };
  struct Watch {
    JobId job = 0;
    uint64_t revision = 0, rays = 0;
    OnChange changed;
  };

  void loop();
  void take(SyncMessage message, OnAnswer done);
  absl::Status record(const SyncMessage& message, Worker* worker, SyncAnswer* answer);
  absl::Status give_out();
  absl::StatusOr<Assignment> assignment(TaskId task, const std::string& attempt);
  absl::StatusOr<std::optional<Digest>> inputs_of(const Task& task);
  void answer_due();
  void measure_rays();
  void tell_watchers();
  JobStatus status_of(Job job);
  std::string new_token();

  Store* store_;
  BlobStore* blobs_;
  Clock clock_;
  CoordinatorOptions options_;

  std::mutex mutex_;  // guards all below
  std::condition_variable wake_;
  bool stop_ = false, work_ = false;
  std::vector<std::pair<SyncMessage, OnAnswer>> inbox_;
  std::vector<Watch> watches_;
  std::map<std::string, Worker> workers_;
  std::map<JobId, Rays> rays_;
  std::vector<Pending> pending_;
  std::map<std::string, TaskId> tasks_;                  // of attempts that are out
  std::map<std::pair<JobId, uint32_t>, Digest> inputs_;  // of stages that have begun
  std::thread thread_;
};

/// The process's clock: Unix time when it was made, and steady from then on.
Coordinator::Clock steady_unix_clock();

}  // namespace lightloom
