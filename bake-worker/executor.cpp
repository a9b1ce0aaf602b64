#include "bake-worker/executor.h"

#include <new>

#include "core/base/text.h"

namespace lightloom {

absl::StatusOr<TaskOutput> run_within_memory(TaskExecutor* executor, const BakeTask& task,
                                             const BakeControl& control) try {
  return executor->run(task, control);
} catch (const std::bad_alloc&) {
  return absl::ResourceExhaustedError("out of memory in task '" + printable(task.kind, 64) +
                                      "'; give the worker more memory, or fewer --threads");
}

}  // namespace lightloom
