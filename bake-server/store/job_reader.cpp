#include "bake-server/store/job_reader.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <string>

#include "bake-server/store/packed_digests.h"
#include "bake-server/store/schema.h"

namespace lightloom {
namespace {

absl::Status no_job(JobId id) {
  return absl::NotFoundError(absl::StrCat("there is no job ", id, " here: check its number and the server"));
}

TaskState task_state(StoredTask stored, JobState job, bool stage_is_open) {
  if (stored == StoredTask::kDone) return TaskState::kDone;
  if (stored == StoredTask::kFailed) return TaskState::kFailed;
  if (job != JobState::kRunning) return TaskState::kCancelled;
  return stage_is_open ? TaskState::kReady : TaskState::kBlocked;
}

absl::StatusOr<std::vector<std::string>> who_failed(Database& database, TaskId task) {
  std::vector<std::string> workers;
  Query query = database.query(
      "SELECT DISTINCT worker FROM attempts INDEXED BY attempts_by_task WHERE task = ?1 AND state = ?2"
      " ORDER BY worker",
      task, number(AttemptState::kFailed));
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, query.step());
    if (!row) return workers;
    workers.push_back(query.bytes(0));
  }
}

absl::Status view_ready(Database& database, int64_t open_stage, uint32_t limit, JobView* view) {
  // INDEXED BY: without that index the statement does not compile, so it cannot silently become a scan.
  Query query = database.query(
      "SELECT id, ord, failures FROM tasks INDEXED BY tasks_idle WHERE job = ?1 AND stage = ?2 AND state = 0 AND "
      "live = 0"
      " ORDER BY ord, id LIMIT ?3",
      view->id, open_stage, limit);
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, query.step());
    if (!row) return absl::OkStatus();
    JobView::Ready& task = view->ready.emplace_back();
    task.task = query.integer(0);
    task.order = query.integer(1);
    if (query.integer(2) > 0) {
      LL_ASSIGN_OR_RETURN(task.failed_by, who_failed(database, task.task));
    }
  }
}

absl::Status view_running(Database& database, JobView* view) {
  // CROSS JOIN: tasks first, then their attempts; one row per attempt.
  Query query = database.query(
      "SELECT t.id, t.ord, a.leased_ms, a.worker FROM tasks t INDEXED BY tasks_live"
      " CROSS JOIN attempts a INDEXED BY attempts_live ON a.task = t.id AND a.state = 0"
      " WHERE t.job = ?1 AND t.live > 0 ORDER BY t.ord, t.id, a.id",
      view->id);
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, query.step());
    if (!row) return absl::OkStatus();
    if (view->running.empty() || view->running.back().task != query.integer(0)) {
      view->running.push_back(
          {.task = query.integer(0), .order = query.integer(1), .leased_ms = query.integer(2), .workers = {}});
    }
    JobView::Running& task = view->running.back();
    task.workers.push_back(query.bytes(3));
    task.leased_ms = std::min(task.leased_ms, query.integer(2));
    ++task.live;
    ++view->live;
  }
}

}  // namespace

absl::StatusOr<JobState> state_of(Database& database, JobId job) {
  Query query = database.query("SELECT state FROM progress WHERE job = ?1", job);
  LL_ASSIGN_OR_RETURN(const bool found, query.step());
  if (!found) return no_job(job);
  return static_cast<JobState>(query.integer(0));
}

absl::StatusOr<Job> read_job(Database& database, JobId id) {
  Job job;
  {
    Query query = database.query(
        "SELECT j.request_id, j.client, j.name, p.priority, j.payload, j.inputs, p.state, j.created_ms, "
        "p.finished_ms,"
        " p.tasks, p.ready, p.running, p.done, p.failed, p.reused, p.revision, p.error"
        " FROM jobs j JOIN progress p ON p.job = j.id WHERE j.id = ?1",
        id);
    LL_ASSIGN_OR_RETURN(const bool found, query.step());
    if (!found) return no_job(id);
    const auto unsigned_at = [&](int column) { return static_cast<uint64_t>(query.integer(column)); };
    job = {.id = id,
           .request_id = query.bytes(0),
           .client = query.bytes(1),
           .name = query.bytes(2),
           .priority = static_cast<int32_t>(query.integer(3)),
           .payload = query.bytes(4),
           .inputs = unpack(query.bytes(5)),
           .state = static_cast<JobState>(query.integer(6)),
           .created_ms = query.integer(7),
           .finished_ms = query.integer(8),
           .tasks = unsigned_at(9),
           .ready = unsigned_at(10),
           .running = unsigned_at(11),
           .done = unsigned_at(12),
           .failed = unsigned_at(13),
           .reused = unsigned_at(14),
           .revision = unsigned_at(15),
           .error = query.bytes(16),
           .outputs = {}};
  }
  if (job.state == JobState::kRunning) return job;
  Query query = database.query(
      "SELECT outputs FROM tasks WHERE job = ?1 AND stage = (SELECT MAX(stage) FROM tasks WHERE job = ?1)"
      " AND state = 1 ORDER BY ord, id",
      id);
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, query.step());
    if (!row) return job;
    for (const Digest& digest : unpack(query.bytes(0))) job.outputs.push_back(digest);
  }
}

absl::StatusOr<std::vector<Job>> read_jobs(Database& database, JobId after_id, uint32_t limit) {
  std::vector<JobId> ids;
  {
    Query query = database.query("SELECT id FROM jobs WHERE id > ?1 ORDER BY id LIMIT ?2", after_id, limit);
    for (;;) {
      LL_ASSIGN_OR_RETURN(const bool row, query.step());
      if (!row) break;
      ids.push_back(query.integer(0));
    }
  }
  std::vector<Job> jobs;
  jobs.reserve(ids.size());
  for (const JobId id : ids) {
    LL_ASSIGN_OR_RETURN(jobs.emplace_back(), read_job(database, id));
  }
  return jobs;
}

absl::StatusOr<Task> read_task(Database& database, TaskId id) {
  Query query = database.query(
      "SELECT t.job, t.kind, t.stage, t.argument, t.ord, t.live, t.failures, t.error, t.outputs, t.state, p.state,"
      " t.stage = p.open_stage FROM tasks t JOIN progress p ON p.job = t.job WHERE t.id = ?1",
      id);
  LL_ASSIGN_OR_RETURN(const bool found, query.step());
  if (!found) return absl::NotFoundError(absl::StrCat("there is no task ", id, " here: check its number"));
  return Task{.id = id,
              .job = query.integer(0),
              .kind = query.bytes(1),
              .stage = static_cast<uint32_t>(query.integer(2)),
              .argument = query.bytes(3),
              .order = query.integer(4),
              .state = task_state(static_cast<StoredTask>(query.integer(9)), static_cast<JobState>(query.integer(10)),
                                  query.integer(11) != 0),
              .live = static_cast<uint32_t>(query.integer(5)),
              .failures = static_cast<uint32_t>(query.integer(6)),
              .error = query.bytes(7),
              .outputs = unpack(query.bytes(8))};
}

absl::StatusOr<std::vector<TaskOutputs>> read_outputs(Database& database, JobId job, uint32_t stage) {
  LL_RETURN_IF_ERROR(state_of(database, job).status());
  std::vector<TaskOutputs> all;
  Query query = database.query(
      "SELECT id, ord, kind, argument, outputs FROM tasks INDEXED BY tasks_by_order"
      " WHERE job = ?1 AND stage = ?2 AND state = 1 ORDER BY ord, id",
      job, stage);
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, query.step());
    if (!row) return all;
    all.push_back({.task = query.integer(0),
                   .order = query.integer(1),
                   .kind = query.bytes(2),
                   .argument = query.bytes(3),
                   .outputs = unpack(query.bytes(4))});
  }
}

absl::StatusOr<std::vector<Event>> read_events(Database& database, JobId job, int64_t after_id, uint32_t limit) {
  LL_RETURN_IF_ERROR(state_of(database, job).status());
  std::vector<Event> events;
  Query query =
      database.query("SELECT id, at_ms, task, worker, what FROM events WHERE job = ?1 AND id > ?2 ORDER BY id LIMIT ?3",
                     job, after_id, limit);
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, query.step());
    if (!row) return events;
    events.push_back({.id = query.integer(0),
                      .at_ms = query.integer(1),
                      .task = query.integer(2),
                      .worker = query.bytes(3),
                      .what = query.bytes(4)});
  }
}

absl::StatusOr<std::vector<JobView>> read_view(Database& database, uint32_t per_job_limit) {
  std::vector<JobView> views;
  Query running = database.query(
      "SELECT j.id, j.client, p.priority, p.open_stage FROM progress p INDEXED BY progress_running"
      " CROSS JOIN jobs j ON j.id = p.job WHERE p.state = 0 ORDER BY p.job");
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, running.step());
    if (!row) return views;
    JobView& view = views.emplace_back();
    view.id = running.integer(0);
    view.client = running.bytes(1);
    view.priority = static_cast<int32_t>(running.integer(2));
    LL_RETURN_IF_ERROR(view_ready(database, running.integer(3), per_job_limit, &view));
    LL_RETURN_IF_ERROR(view_running(database, &view));
  }
}

}  // namespace lightloom
