#include "bake-worker/executor.h"

#include <absl/strings/str_cat.h>

#include <new>
#include <string>

#include "core/base/text.h"

namespace lightloom {
namespace {

constexpr char kOutOfMemory[] = "out of memory in task";

}  // namespace

absl::Status out_of_memory(const std::string& kind) {
  return absl::ResourceExhaustedError(
      absl::StrCat(kOutOfMemory, " '", printable(kind, 64), "'; give the worker more memory, or fewer --threads"));
}

absl::StatusOr<TaskOutput> run_within_memory(TaskExecutor* executor, const BakeTask& task,
                                             const BakeControl& control) try {
  return executor->run(task, control);
} catch (const std::bad_alloc&) {
  return out_of_memory(task.kind);
}

bool is_out_of_memory(const absl::Status& status) {
  // Other resources run out, too: disks, on the server.
  return absl::IsResourceExhausted(status) && std::string(status.message()).starts_with(kOutOfMemory);
}

}  // namespace lightloom
