// The work of a bake farm: tasks as pure functions from bytes to named blobs. Whoever hands them out knows no method.
//
//   kind      stage  argument          outputs[0]       further outputs
//   plan        0    earlier results   PlanSummary      ReusedResults  asks for all other tasks
//   cell        1    one planned cell  CellRecord       its chunk
//   relight     1    probes            RelightRecords   the chunk of each
//   surfaces    1    objects           chunk refs       the chunk of each object that has receivers
//   assemble    2    -                 the manifest     the traces
//   warm        -    empty             -                -              nobody asks for it: makes the session
#pragma once

#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <span>
#include <string>
#include <vector>

#include "core/bake/plan.h"
#include "core/bake/session.h"
#include "core/bake/task_blobs.h"
#include "core/bake/task_list.h"

namespace lightloom {

/// Content-addressed blobs, wherever they are. Called from any thread.
class BlobAccess {
 public:
  virtual ~BlobAccess() = default;
  /// NotFound if there is none.
  virtual absl::StatusOr<std::vector<uint8_t>> get(const Digest& digest) = 0;
  /// All of them, or an error. Their names are their SHA-256.
  virtual absl::Status put(const std::vector<std::vector<uint8_t>>& blobs) = 0;
};

struct BakeTask {
  std::string kind;
  std::vector<uint8_t> payload;   ///< encode_payload()
  std::vector<uint8_t> argument;  ///< as it was asked for
  Digest inputs;                  ///< assemble: blob of encode_task_list(), all tasks of the stages below
};

/// A task that another one asks for. It may run once all tasks of lower stages are done.
struct SpawnedTask {
  std::string kind;
  uint32_t stage = 0;
  std::vector<uint8_t> argument;
  int64_t order = 0;  ///< neighbours have near numbers
};

struct TaskOutput {
  std::vector<Digest> outputs;  ///< the same in every run, on every machine
  std::vector<SpawnedTask> spawned;
  uint64_t rays = 0;  ///< shot this time: fewer by a worker that remembers more
};

/// Probes of one "relight" task, and objects of one "surfaces" task.
inline constexpr uint32_t kRelightProbes = 16, kSurfaceObjects = 1024;

/// The job's first task; it asks for the others. `earlier`, if any, has results that are used again where they hold.
SpawnedTask first_task(const EarlierResults* earlier = nullptr);

/// Runs tasks. Thread-safe: tasks of one payload share a BakeSession, which the first of them makes while others wait.
class TaskRunner {
 public:
  /// Calls `wait`, which returns when another task has got further: others must compute meanwhile, that one too.
  using Aside = std::function<void(const std::function<void()>& wait)>;

  /// Keeps sessions warm within `cache_bytes` (BakeSession::bytes()): beyond it those that were used least recently go, but
  /// never one in use, nor the last. `blobs` must outlive the runner. `aside` may be null: threads are free to wait.
  explicit TaskRunner(BlobAccess* blobs, uint64_t cache_bytes = uint64_t{1} << 30, Aside aside = nullptr);
  ~TaskRunner();

  /// A session that is at hand for tasks of this payload: they read no level blob then.
  void adopt(std::span<const uint8_t> payload, std::shared_ptr<const BakeSession> session);

  /// Reports the stages "receivers" and "probes" where it has to plan first, then "relight", "surfaces", "assemble".
  /// Errors: unknown kind or bytes that cannot be read (InvalidArgument), an index that is not planned (OutOfRange), a
  /// plan or method other than the worker's (FailedPrecondition), cancellation, and those of planning and of `blobs`.
  absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control = {});

 private:
  /// A payload's session, or that it is being made.
  struct Warm;

  absl::StatusOr<std::shared_ptr<const BakeSession>> session_of(const BakeTask& task, const BakeControl& control);
  absl::StatusOr<std::shared_ptr<const BakeSession>> make_session(const BakeTask& task, const BakeControl& control);
  void trim();

  BlobAccess& blobs_;
  const uint64_t cache_bytes_;
  const Aside aside_;
  std::mutex mutex_;
  std::condition_variable made_;
  std::vector<std::shared_ptr<Warm>> warm_;  // used last first; guarded by mutex_, and what it points to
};

}  // namespace lightloom
