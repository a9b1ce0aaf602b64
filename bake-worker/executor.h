// Where a worker's tasks run.
#pragma once

#include <string>

#include "core/bake/task_runner.h"

namespace lightloom {

/// Thread-safe: called from as many threads as tasks run.
class TaskExecutor {
 public:
  virtual ~TaskExecutor() = default;
  /// As TaskRunner::run. Of control.progress only the rays are told, of no stage in particular. ResourceExhausted: memory
  /// ran out. Internal: the task ended the process that ran it.
  virtual absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control) = 0;
  /// An error once no task can run here any more; errors of run() from then on say nothing about their tasks.
  virtual absl::Status health() { return absl::OkStatus(); }
};

/// That a task of this kind found no memory, or no room for a thread: ResourceExhausted.
absl::Status out_of_memory(const std::string& kind);
/// executor.run(); running out of memory fails the task, not the process: out_of_memory().
absl::StatusOr<TaskOutput> run_within_memory(TaskExecutor* executor, const BakeTask& task, const BakeControl& control);
/// Whether it is that error.
bool is_out_of_memory(const absl::Status& status);

}  // namespace lightloom
