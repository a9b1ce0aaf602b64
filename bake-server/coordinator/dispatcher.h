// The farm's decisions, one step at a time: hears workers, keeps leases, gives out tasks. No thread, no clock; it holds
// nothing that a restart would miss: what counts is in the store.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "bake-server/blobs/blob_store.h"
#include "bake-server/coordinator/ray_meter.h"
#include "bake-server/scheduler/decide.h"
#include "bake-server/scheduler/worker_session.h"
#include "bake-server/store/store.h"
#include "core/base/random_id.h"

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
  int32_t priority = 0;  ///< the job's
  std::string payload, kind, argument;
  std::optional<Digest> inputs;  ///< blob that lists what the stages below gave
};

struct SyncAnswer {
  uint64_t sequence = 0;
  std::vector<std::string> acknowledged, lost;
  std::vector<Assignment> assignments;
  std::vector<std::string> warm;  ///< payloads whose tasks are on their way
  uint32_t lease_ms = 0;
};

struct WorkerStatus {
  std::string id, version;
  uint32_t threads = 0, running = 0;
  int64_t silent_ms = 0;
  bool draining = false;
};

struct DispatchOptions {
  uint32_t lease_ms = 30'000;
  uint32_t max_failures = 3;                           ///< of a task, then it has failed for good
  std::function<bool()> paused;                        ///< gives out nothing while true; null: never
  std::function<std::string()> new_token = random_id;  ///< names an attempt
  DecideOptions decide;
};

/// Not thread-safe. Every time is the caller's, in milliseconds that never run backwards. The store and the blobs must
/// outlive it.
class Dispatcher {
 public:
  Dispatcher(Store* store, BlobStore* blobs, DispatchOptions options)
      : store_(store), blobs_(blobs), options_(std::move(options)) {}

  using OnAnswer = std::function<void(absl::StatusOr<SyncAnswer>)>;
  /// An answer for whoever waits for it.
  struct Answered {
    OnAnswer to;
    absl::StatusOr<SyncAnswer> answer;
  };

  /// Puts on record what the worker says. The answer comes out of step() at once if there is something to say, else when
  /// there is, or when the worker's wait is over. Aborted: an old message, or one that a newer one overtook.
  void hear(SyncMessage message, OnAnswer answer, int64_t now_ms);
  /// Ends leases that are over, gives out tasks. Returns the answers that are due.
  std::vector<Answered> step(int64_t now_ms);
  /// All who wait get this error.
  std::vector<Answered> give_up(const absl::Status& status);
  /// Who waits is answered with the next step: there may be news that only a new Sync brings.
  void wake_all();

  std::vector<WorkerStatus> workers(int64_t now_ms) const;
  /// Workers that have a task of the job.
  uint32_t workers_of(JobId job) const;
  const RayMeter& rays() const { return rays_; }

 private:
  struct Held {
    JobId job = 0;
    TaskId task = 0;
    uint64_t rays = 0;  ///< so far
  };
  struct Worker {
    WorkerSession session;
    std::string version;
    uint32_t threads = 0;
    bool draining = false;
    uint32_t failed_in_row = 0;
    int64_t heard_ms = 0;
    std::map<std::string, Held> held;  // by attempt
    std::set<JobId> warmed;            // that it was told of before it got their tasks
    JobId last_job = 0;
    int64_t last_order = 0;
  };
  struct Pending {
    std::string worker;
    uint32_t room = 0;
    int64_t until_ms = 0;
    SyncAnswer answer;
    bool urgent = false;  // there is something to say
    OnAnswer to;
  };

  absl::Status record(const SyncMessage& message, Worker* worker, SyncAnswer* answer, int64_t now_ms);
  absl::Status resend(const std::vector<std::string>& attempts, Worker* worker, Pending* pending, int64_t now_ms);
  absl::Status give_out(int64_t now_ms);
  absl::Status warm_up(const std::vector<JobId>& jobs);
  absl::StatusOr<Assignment> assignment(TaskId task, const std::string& attempt, int32_t priority);
  absl::StatusOr<std::optional<Digest>> inputs_of(const Task& task);
  std::vector<Answered> take_due(int64_t now_ms);
  void answer(Pending* pending, const absl::Status& status);
  static void forget(const std::string& attempt, Worker* worker);

  Store* store_;
  BlobStore* blobs_;
  DispatchOptions options_;
  std::map<std::string, Worker> workers_;
  std::vector<Pending> pending_;
  std::vector<Answered> answered_;                       // out with the next step
  std::map<std::pair<JobId, uint32_t>, Digest> inputs_;  // of stages of running jobs
  std::map<JobId, std::string> payloads_;                // of running jobs: they do not change
  RayMeter rays_;
};

}  // namespace lightloom
