#include "bake-server/store/job_content.h"

#include <absl/strings/str_cat.h>

#include "bake-server/store/packed_digests.h"
#include "core/base/text.h"

namespace lightloom {

std::string content_of(const NewJob& job) {
  Hasher hasher;
  hasher.string(job.name).value(job.priority).string(job.payload).array(job.inputs);
  hasher.value(static_cast<uint64_t>(job.tasks.size()));
  for (const NewTask& task : job.tasks) {
    hasher.string(task.kind).value(task.stage).string(task.argument).value(task.order);
  }
  return pack({hasher.finish()});
}

std::string work_of(const NewJob& job) {
  Hasher hasher;
  hasher.string(job.payload).array(job.inputs).value(static_cast<uint64_t>(job.tasks.size()));
  for (const NewTask& task : job.tasks) hasher.string(task.kind).value(task.stage).string(task.argument);
  return pack({hasher.finish()});
}

std::string key_of(std::string_view work, const NewTask& task) {
  if (work.empty()) return {};
  return pack({Hasher().string(work).string(task.kind).value(task.stage).string(task.argument).finish()});
}

absl::Status check_arguments(const std::vector<NewTask>& tasks) {
  for (size_t i = 0; i < tasks.size(); ++i) {
    if (tasks[i].argument.size() <= kMaxArgument) continue;
    return absl::InvalidArgumentError(absl::StrCat("task ", i, " has an argument of ", tasks[i].argument.size(),
                                                   " bytes, the limit is ", kMaxArgument,
                                                   ": store it as a blob and give its digest"));
  }
  return absl::OkStatus();
}

absl::Status check_job(const NewJob& job) {
  if (job.request_id.empty()) return absl::InvalidArgumentError("the job has no request id: make one per request");
  if (job.tasks.empty()) {
    return absl::InvalidArgumentError(
        absl::StrCat("the job '", printable(job.name), "' has no tasks: give it at least one"));
  }
  if (job.payload.size() > kMaxPayload) {
    return absl::InvalidArgumentError(absl::StrCat("the job '", printable(job.name), "' has a payload of ",
                                                   job.payload.size(), " bytes, the limit is ", kMaxPayload,
                                                   ": store it as a blob and name it in the inputs"));
  }
  return check_arguments(job.tasks);
}

}  // namespace lightloom
