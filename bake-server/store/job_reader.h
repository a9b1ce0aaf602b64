// Reads jobs and tasks out of the database: what Store says of each.
#pragma once

#include <cstdint>
#include <vector>

#include "bake-server/store/database.h"
#include "bake-server/store/store.h"

namespace lightloom {

absl::StatusOr<JobState> state_of(Database& database, JobId job);
absl::StatusOr<Job> read_job(Database& database, JobId id);
absl::StatusOr<std::vector<Job>> read_jobs(Database& database, JobId after_id, uint32_t limit);
absl::StatusOr<Task> read_task(Database& database, TaskId id);
absl::StatusOr<std::vector<TaskOutputs>> read_outputs(Database& database, JobId job, uint32_t stage);
absl::StatusOr<std::vector<Event>> read_events(Database& database, JobId job, int64_t after_id, uint32_t limit);
absl::StatusOr<std::vector<JobView>> read_view(Database& database, uint32_t per_job_limit);

}  // namespace lightloom
