#include "bake-server/store/job_progress.h"

#include <absl/strings/str_cat.h>

#include <utility>

#include "bake-server/store/job_content.h"
#include "bake-server/store/packed_digests.h"
#include "bake-server/store/schema.h"

namespace lightloom {
namespace {

const char* name_of(JobState state) {
  switch (state) {
    case JobState::kRunning:
      return "running";
    case JobState::kDone:
      return "done";
    case JobState::kPartial:
      return "partial";
    case JobState::kFailed:
      return "failed";
    case JobState::kCancelled:
      return "cancelled";
  }
  return "unknown";
}

}  // namespace

absl::Status JobProgress::insert_tasks(JobId job, std::string_view work, const std::vector<NewTask>& tasks,
                                       TaskId spawner) {
  for (const NewTask& task : tasks) {
    const std::string key = key_of(work, task);
    LL_RETURN_IF_ERROR(
        database_.send("INSERT INTO tasks (job, stage, ord, kind, argument, key, spawner)"
                       " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
                       job, task.stage, task.order, task.kind, Blob{task.argument}, Blob{key}, spawner));
  }
  return absl::OkStatus();
}

absl::Status JobProgress::add_tasks(JobId job, int64_t n) {
  return database_.send("UPDATE progress SET tasks = tasks + ?2 WHERE job = ?1", job, n);
}

absl::Status JobProgress::reuse(JobId job, int64_t now_ms) {
  std::vector<std::pair<TaskId, TaskId>> known;  // a task, and its twin that is done
  {
    // One twin each: results are pure functions of the key.
    Query query = database_.query(
        "SELECT id, twin FROM"
        " (SELECT t.id AS id, (SELECT d.id FROM tasks d INDEXED BY tasks_results WHERE d.key = t.key AND d.state = 1"
        "  AND NOT EXISTS (SELECT 1 FROM attempts a INDEXED BY attempts_by_task WHERE a.task = d.id AND a.state = ?2)"
        "  LIMIT 1) AS twin FROM tasks t INDEXED BY tasks_idle JOIN progress p ON p.job = t.job"
        "  WHERE t.job = ?1 AND t.stage = p.open_stage AND t.state = 0 AND t.live = 0 AND t.key != x'') AS idle"
        " WHERE twin IS NOT NULL",
        job, number(AttemptState::kMismatched));
    for (;;) {
      LL_ASSIGN_OR_RETURN(const bool row, query.step());
      if (!row) break;
      known.emplace_back(query.integer(0), query.integer(1));
    }
  }
  if (there_) {
    for (auto& [task, twin] : known) {
      Query of = database_.query("SELECT outputs FROM tasks WHERE id = ?1", twin);
      LL_RETURN_IF_ERROR(of.step().status());
      if (!there_(unpack(of.bytes(0)))) twin = 0;
    }
    std::erase_if(known, [](const auto& pair) { return pair.second == 0; });
  }
  for (const auto& [task, twin] : known) {
    LL_RETURN_IF_ERROR(
        database_.send("UPDATE tasks SET state = 1, outputs = (SELECT outputs FROM tasks WHERE id = ?2)"
                       " WHERE id = ?1",
                       task, twin));
    LL_ASSIGN_OR_RETURN(const int64_t spawned,
                        database_.run("INSERT INTO tasks (job, stage, ord, kind, argument, key, spawner)"
                                      " SELECT ?1, stage, ord, kind, argument, key, ?2"
                                      " FROM tasks INDEXED BY tasks_spawned WHERE spawner = ?3 AND spawner != 0"
                                      " ORDER BY id",
                                      job, task, twin));
    if (spawned > 0) LL_RETURN_IF_ERROR(add_tasks(job, spawned));
    LL_RETURN_IF_ERROR(record(job, now_ms, task, "", "reused"));
  }
  const auto n = static_cast<int64_t>(known.size());
  if (n == 0) return absl::OkStatus();
  LL_RETURN_IF_ERROR(count(job, {.ready = -n, .done = n}));
  return database_.send("UPDATE progress SET reused = reused + ?2 WHERE job = ?1", job, n);
}

absl::Status JobProgress::count(JobId job, const Counts& change) {
  return database_.send(
      "UPDATE progress SET ready = ready + ?2, running = running + ?3, done = done + ?4, failed = failed + ?5,"
      " revision = revision + 1 WHERE job = ?1",
      job, change.ready, change.running, change.done, change.failed);
}

absl::Status JobProgress::record(JobId job, int64_t at_ms, TaskId task, std::string_view worker,
                                 std::string_view what) {
  return database_.send("INSERT INTO events (job, at_ms, task, worker, what) VALUES (?1, ?2, ?3, ?4, ?5)", job, at_ms,
                        task, worker, what);
}

absl::Status JobProgress::advance(JobId job, int64_t now_ms) {
  for (;;) {
    int64_t failed = 0;
    int64_t blocked = 0;
    int64_t done = 0;
    {
      Query query = database_.query(
          "SELECT ready + running, failed, tasks - ready - running - done - failed, done FROM progress"
          " WHERE job = ?1",
          job);
      LL_RETURN_IF_ERROR(query.step().status());
      if (query.integer(0) > 0) return absl::OkStatus();
      failed = query.integer(1);
      blocked = query.integer(2);
      done = query.integer(3);
    }
    if (failed > 0) return end(job, blocked > 0 || done == 0 ? JobState::kFailed : JobState::kPartial, now_ms);
    if (blocked == 0) return end(job, JobState::kDone, now_ms);
    LL_RETURN_IF_ERROR(
        database_.send("UPDATE progress SET open_stage = (SELECT MIN(stage) FROM tasks"
                       " WHERE job = ?1 AND stage > open_stage) WHERE job = ?1",
                       job));
    LL_RETURN_IF_ERROR(
        database_.send("UPDATE progress SET ready = (SELECT COUNT(*) FROM tasks WHERE job = ?1 AND stage = open_stage)"
                       " WHERE job = ?1",
                       job));
    LL_RETURN_IF_ERROR(reuse(job, now_ms));
  }
}

absl::Status JobProgress::end(JobId job, JobState state, int64_t now_ms) {
  std::string error;
  if (state == JobState::kPartial || state == JobState::kFailed) {
    Query query = database_.query(
        "SELECT id, kind, error FROM tasks INDEXED BY tasks_failed WHERE job = ?1 AND state = 2"
        " ORDER BY ord, id LIMIT 1",
        job);
    LL_ASSIGN_OR_RETURN(const bool found, query.step());
    if (found) error = absl::StrCat("task ", query.integer(0), " (", query.bytes(1), "): ", query.bytes(2));
  }
  LL_RETURN_IF_ERROR(
      database_.send("UPDATE progress SET state = ?2, ready = 0, running = 0, finished_ms = ?3, error = ?4,"
                     " revision = revision + 1 WHERE job = ?1",
                     job, number(state), now_ms, error));
  return record(job, now_ms, 0, "", absl::StrCat("ended: ", name_of(state)));
}

}  // namespace lightloom
