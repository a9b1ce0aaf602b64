// How a job goes on: its counts, its stages, its end, and results of earlier jobs that are used again.
#pragma once

#include <cstdint>
#include <functional>
#include <string_view>
#include <vector>

#include "bake-server/store/database.h"
#include "bake-server/store/store.h"

namespace lightloom {

/// Changes of a job's counts.
struct Counts {
  int64_t ready = 0;
  int64_t running = 0;
  int64_t done = 0;
  int64_t failed = 0;
};

/// All within the caller's transaction.
class JobProgress {
 public:
  /// `there`: whether these outputs still are, so that they can be used again; null: always.
  JobProgress(Database* database, std::function<bool(const std::vector<Digest>&)> there)
      : database_(*database), there_(std::move(there)) {}

  absl::Status insert_tasks(JobId job, std::string_view work, const std::vector<NewTask>& tasks, TaskId spawner);
  absl::Status add_tasks(JobId job, int64_t n);
  /// The job changed, and maybe its counts.
  absl::Status count(JobId job, const Counts& change);
  absl::Status record(JobId job, int64_t at_ms, TaskId task, std::string_view worker, std::string_view what);
  /// Tasks of the open stage whose results are known get them, and what followed from them.
  /// REQUIRES: the stage has just opened: all its tasks are ready.
  absl::Status reuse(JobId job, int64_t now_ms);
  /// Opens the next stage or ends the job, as often as the open stage has nothing left to do.
  absl::Status advance(JobId job, int64_t now_ms);
  /// REQUIRES: the job runs and has no live attempts.
  absl::Status end(JobId job, JobState state, int64_t now_ms);

 private:
  Database& database_;
  const std::function<bool(const std::vector<Digest>&)> there_;
};

}  // namespace lightloom
