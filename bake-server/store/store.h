// What the farm remembers: jobs, their tasks, who works on which, and what happened. No coordinator holds authoritative
// memory: it decides from a view() and asks for transitions, each one atomic, durable, conditional step here.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

using JobId = int64_t;   ///< 1 or more, never given twice; grows with the time of submission
using TaskId = int64_t;  ///< 1 or more, never given twice

// Implementations store the numbers: never renumber.
enum class JobState {
  kRunning = 0,
  kDone = 1,
  kPartial = 2,    ///< ended; some tasks of the last stage failed for good, the other outputs are there
  kFailed = 3,     ///< ended; failed tasks kept a later stage from opening, or nothing was done at all
  kCancelled = 4,  ///< ended by cancel()
};

enum class TaskState {
  kBlocked = 0,    ///< waits for a lower stage
  kReady = 1,      ///< may be leased; attempts may be live
  kDone = 2,       ///< has its outputs
  kFailed = 3,     ///< for good: it failed too often
  kCancelled = 4,  ///< its job ended before it was done
};

/// A pure function's name and argument. Tasks of a stage are ready once all tasks of their job's lower stages are done.
struct NewTask {
  std::string kind;
  uint32_t stage = 0;
  std::string argument;  ///< opaque, at most kMaxArgument bytes
  int64_t order = 0;     ///< lower first; neighbours have near numbers. Equal ones follow in the order of submission.
  bool operator==(const NewTask&) const = default;
};

inline constexpr size_t kMaxArgument = size_t{4} << 10;
inline constexpr size_t kMaxPayload = size_t{64} << 10;
inline constexpr size_t kMaxReason = 1024;  ///< bytes of a failure's reason that are kept

struct NewJob {
  std::string request_id;  ///< made by the client, not empty; unique per client
  std::string client;
  std::string name;
  int32_t priority = 0;  ///< higher first
  std::string payload;   ///< opaque, at most kMaxPayload bytes
  std::vector<Digest> inputs;
  std::vector<NewTask> tasks;  ///< at least one

  // What a task yields must follow from payload, inputs, these tasks, and the task itself: results are used again.
};

struct Job {
  JobId id = 0;
  std::string request_id;
  std::string client;
  std::string name;
  int32_t priority = 0;
  std::string payload;
  std::vector<Digest> inputs;
  JobState state = JobState::kRunning;
  int64_t created_ms = 0;
  int64_t finished_ms = 0;  ///< 0 while it runs
  // Of its tasks; those counted nowhere else are blocked or cancelled.
  uint64_t tasks = 0;    ///< all of them, spawned ones too
  uint64_t ready = 0;    ///< without a live attempt
  uint64_t running = 0;  ///< ready ones with live attempts
  uint64_t done = 0;
  uint64_t failed = 0;          ///< for good
  uint64_t reused = 0;          ///< of those that are done: taken from an earlier job
  uint64_t revision = 0;        ///< grows with every change of the job
  std::string error;            ///< once it ended kPartial or kFailed: which task failed first (in order), and why
  std::vector<Digest> outputs;  ///< once it ended: those of its last stage's done tasks, in order
};

struct Task {
  TaskId id = 0;
  JobId job = 0;
  std::string kind;
  uint32_t stage = 0;
  std::string argument;
  int64_t order = 0;
  TaskState state = TaskState::kBlocked;
  uint32_t live = 0;      ///< live attempts
  uint32_t failures = 0;  ///< failed attempts; expired and released ones are none
  std::string error;      ///< the last failure's reason; empty once it is done
  std::vector<Digest> outputs;
};

/// One worker's try at one task.
struct NewLease {
  TaskId task = 0;
  std::string worker;
  std::string token;  ///< names the attempt from here on: not empty, unique among all that were ever chosen
  int64_t expires_ms = 0;
  uint32_t max_live = 1;  ///< live attempts that the task may have, this one included
};

enum class Completion {
  kAccepted,
  kAlreadyDone,  ///< the task is done with equal outputs: nothing changed
  kMismatch,  ///< the task is done with other outputs: nothing changed but for an event, one per attempt, that says so
  kUnknown,   ///< no attempt has this token
  kJobEnded,  ///< the task was never done, and its job is over: nothing changed
};

struct TaskOutputs {
  TaskId task = 0;
  int64_t order = 0;
  std::string kind;
  std::string argument;
  std::vector<Digest> outputs;
};

struct Event {
  int64_t id = 0;  ///< 1 or more, grows
  int64_t at_ms = 0;
  TaskId task = 0;     ///< 0: the job itself
  std::string worker;  ///< empty: no worker's doing
  /// "submitted", "leased", "completed", "reused", "failed: <reason>", "expired", "released", "mismatch", "cancelled",
  /// "ended: done", "ended: partial", "ended: failed", "ended: cancelled".
  std::string what;
};

/// What a scheduler decides from.
struct JobView {
  struct Ready {
    TaskId task = 0;
    int64_t order = 0;
    std::vector<std::string> failed_by = {};  ///< workers that failed it, each once, by name
    bool operator==(const Ready&) const = default;
  };
  struct Running {
    TaskId task = 0;
    int64_t order = 0;
    uint32_t live = 0;
    int64_t leased_ms = 0;             ///< when its oldest live attempt began
    std::vector<std::string> workers;  ///< of its live attempts, oldest first: they get no second one
    bool operator==(const Running&) const = default;
  };

  JobId id = 0;
  std::string client;
  int32_t priority = 0;
  uint64_t live = 0;             ///< live attempts
  std::vector<Ready> ready;      ///< the first ready tasks without a live attempt, in order
  std::vector<Running> running;  ///< all tasks with live attempts, in order
};

/// What forget_ended() did.
struct Forgotten {
  uint64_t jobs = 0;  ///< that are gone
  bool more = false;  ///< the limit came first: call again
};

/// May refuse a job that is about to be made.
using AdmitJob = std::function<absl::Status(const NewJob&)>;

/// Returns false to be called no more.
using VisitDigest = std::function<bool(const Digest&)>;

/// Thread-safe. Calls read no clock and make no random numbers: times are the caller's, in milliseconds, and so are tokens.
/// A call either returns after its change is durable, or changes nothing and returns an error: ResourceExhausted if the
/// disk is full (worth another try once it is not), DataLoss if the stored state is damaged, Unavailable or
/// PermissionDenied if it cannot be reached.
class Store {
 public:
  Store() = default;
  virtual ~Store() = default;
  Store(const Store&) = delete;
  Store& operator=(const Store&) = delete;

  /// The clock that times here are by, where nothing else is said: of all who share the store the same, in milliseconds of Unix
  /// time that never run backwards. Waits for nobody.
  virtual int64_t now_ms() = 0;

  /// Makes what `calls` does with this store durable together, once: all of it, or, if it or the end fails, nothing.
  /// Other threads wait meanwhile.
  virtual absl::Status group(const std::function<absl::Status()>& calls) = 0;

  /// The job as it is now. The same request again (client, request_id) returns the job that is there; AlreadyExists if
  /// it asked for something else. InvalidArgument beyond the limits above. `admit`, if any, may refuse a job that is not
  /// there yet.
  /// Tasks of a stage that opens, here or later, that an earlier job of any client has done are done at once, with what
  /// they spawned: equal are kind, stage and argument, of jobs with equal payload, inputs and tasks. Not those that
  /// raised the alarm (kMismatch), nor those whose outputs are no longer there.
  virtual absl::StatusOr<Job> submit(const NewJob& job, int64_t now_ms, const AdmitJob& admit = nullptr) = 0;
  /// Idempotent; an ended job stays as it ended. All its attempts end. NotFound if there is no such job.
  virtual absl::Status cancel(JobId job, int64_t now_ms) = 0;
  /// Idempotent. NotFound if there is no such job.
  virtual absl::Status set_priority(JobId job, int32_t priority) = 0;

  /// True: the attempt is live now. False, and nothing changed, unless the task is ready, its job runs, it has fewer
  /// than max_live live attempts and the worker has none of them: look again. AlreadyExists for a token used before.
  virtual absl::StatusOr<bool> lease(const NewLease& lease, int64_t now_ms) = 0;
  /// Gives the worker's live attempts among `tokens` until `expires_ms`, and returns their tokens; the others are lost
  /// to it.
  virtual absl::StatusOr<std::vector<std::string>> extend(const std::string& worker,
                                                          const std::vector<std::string>& tokens,
                                                          int64_t expires_ms) = 0;
  /// Hands the worker's live attempts among `tokens` back: no failure.
  virtual absl::Status release(const std::string& worker, const std::vector<std::string>& tokens, int64_t now_ms) = 0;
  /// Ends live attempts with expires_ms < now_ms, which counts as no failure, and returns their tokens.
  virtual absl::StatusOr<std::vector<std::string>> expire(int64_t now_ms) = 0;
  /// Gives every live attempt until `expires_ms`: after a restart, whose clock may have begun anew.
  virtual absl::Status renew_all(int64_t expires_ms) = 0;

  /// The attempt's result. Accepted unless the task is done or the job over, even if the attempt expired, was handed
  /// back or failed, or the task failed for good: results are pure functions of the task, so late is not wrong.
  /// Accepting stores `outputs`, ends the task's other attempts, adds `spawned` to the job (InvalidArgument and nothing
  /// changed, unless their stages lie above this task's), opens the next stage when all tasks of lower ones are done,
  /// and ends the job when nothing is left to do. The same call again is kAlreadyDone: it spawns nothing twice.
  virtual absl::StatusOr<Completion> complete(const std::string& token, const std::vector<Digest>& outputs,
                                              const std::vector<NewTask>& spawned, int64_t now_ms) = 0;
  /// Ends the attempt; false if it was not live, and nothing changed. The task fails for good with its max_failures-th
  /// failed attempt, which ends its other attempts. Other tasks of its stage go on; when none is ready or running, the
  /// job ends: kFailed if tasks of later stages wait or none is done, else kPartial.
  virtual absl::StatusOr<bool> fail(const std::string& token, const std::string& reason, int64_t now_ms,
                                    uint32_t max_failures) = 0;

  /// All running jobs by id, each with its first `per_job_limit` ready tasks. Reads only the rows that it returns.
  virtual absl::StatusOr<std::vector<JobView>> view(uint32_t per_job_limit) = 0;

  /// At most `limit` jobs with ids above `after_id`, by id.
  virtual absl::StatusOr<std::vector<Job>> jobs(JobId after_id, uint32_t limit) = 0;
  // NotFound if there is no such job or task:
  virtual absl::StatusOr<Job> job(JobId id) = 0;
  virtual absl::StatusOr<Task> task(TaskId id) = 0;
  /// What the done tasks of the stage yielded, in order.
  virtual absl::StatusOr<std::vector<TaskOutputs>> outputs(JobId job, uint32_t stage) = 0;
  /// At most `limit` events of the job with ids above `after_id`, by id.
  virtual absl::StatusOr<std::vector<Event>> events(JobId job, int64_t after_id, uint32_t limit) = 0;

  /// Deletes jobs that ended before `before_ms`, oldest first, at most about `limit` rows of them at a time: a job that is
  /// on its way out has fewer events, tasks and outputs from call to call.
  virtual absl::StatusOr<Forgotten> forget_ended(int64_t before_ms, uint32_t limit) = 0;
  /// Visits every digest that a job (inputs) or a task (outputs) names at one moment during the call, some of them often.
  /// Others go on meanwhile.
  virtual absl::Status referenced(const VisitDigest& visit) = 0;
  /// The distinct digests of the client's jobs, sorted.
  virtual absl::StatusOr<std::vector<Digest>> references_of(const std::string& client) = 0;
};

}  // namespace lightloom
