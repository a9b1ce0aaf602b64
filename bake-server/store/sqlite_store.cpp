#include "bake-server/store/sqlite_store.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "bake-server/store/folder_lock.h"
#include "bake-server/store/packed_digests.h"
#include "bake-server/store/sqlite_database.h"
#include "bake-server/store/sqlite_schema.h"
#include "bake-server/store/sqlite_upkeep.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

namespace fs = std::filesystem;

template <class Enum>
int64_t number(Enum value) {
  return static_cast<int64_t>(value);
}

/// Stored, and compared when a request comes again, maybe after an upgrade: never change what is hashed.
std::string content_of(const NewJob& job) {
  Hasher hasher;
  hasher.string(job.name).value(job.priority).string(job.payload).array(job.inputs);
  hasher.value(static_cast<uint64_t>(job.tasks.size()));
  for (const NewTask& task : job.tasks) {
    hasher.string(task.kind).value(task.stage).string(task.argument).value(task.order);
  }
  return pack({hasher.finish()});
}

/// What the results of the job's tasks follow from.
Digest work_of(const NewJob& job) {
  Hasher hasher;
  hasher.string(job.payload).array(job.inputs).value(static_cast<uint64_t>(job.tasks.size()));
  for (const NewTask& task : job.tasks) hasher.string(task.kind).value(task.stage).string(task.argument);
  return hasher.finish();
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

absl::Status no_job(JobId id) {
  return absl::NotFoundError(absl::StrCat("there is no job ", id, " here: check its number and the server"));
}

TaskState task_state(StoredTask stored, JobState job, bool stage_is_open) {
  if (stored == StoredTask::kDone) return TaskState::kDone;
  if (stored == StoredTask::kFailed) return TaskState::kFailed;
  if (job != JobState::kRunning) return TaskState::kCancelled;
  return stage_is_open ? TaskState::kReady : TaskState::kBlocked;
}

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

/// Changes of a job's counts.
struct Counts {
  int64_t ready = 0;
  int64_t running = 0;
  int64_t done = 0;
  int64_t failed = 0;
};

class SqliteStore final : public Store {
 public:
  explicit SqliteStore(std::function<bool(const std::vector<Digest>&)> there) : there_(std::move(there)) {}

  absl::Status open(const fs::path& folder, Durability durability) {
    LL_RETURN_IF_ERROR(lock_.take(folder));
    const fs::path file = folder / "store.db";
    LL_ASSIGN_OR_RETURN(db_, Database::open(file, durability));
    return prepare_sqlite_schema(*db_, file);
  }

  absl::Status group(const std::function<absl::Status()>& calls) override {
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_RETURN_IF_ERROR(calls());
    return transaction.commit();
  }

  absl::StatusOr<Job> submit(const NewJob& job, int64_t now_ms, const AdmitJob& admit) override {
    LL_RETURN_IF_ERROR(check_job(job));
    const std::string content = content_of(job);
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    {
      Query same =
          db_->query("SELECT id, content FROM jobs WHERE client = ?1 AND request_id = ?2", job.client, job.request_id);
      LL_ASSIGN_OR_RETURN(const bool there, same.step());
      if (there && same.bytes(1) != content) {
        return absl::AlreadyExistsError(absl::StrCat("the request id '", printable(job.request_id), "' named job ",
                                                     same.integer(0),
                                                     ", which asked for something else: make a new id per request"));
      }
      if (there) return read_job(same.integer(0));
    }
    if (admit) LL_RETURN_IF_ERROR(admit(job));

    const std::string work = pack({work_of(job)});
    LL_RETURN_IF_ERROR(
        db_->run("INSERT INTO jobs (client, request_id, content, name, created_ms, inputs, payload, work)"
                 " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)",
                 job.client, job.request_id, Blob{content}, job.name, now_ms, Blob{pack(job.inputs)}, Blob{job.payload},
                 Blob{work})
            .status());
    const JobId id = db_->last_insert_id();
    LL_RETURN_IF_ERROR(insert_tasks(id, work, job.tasks, 0));
    uint32_t first_stage = job.tasks[0].stage;
    for (const NewTask& task : job.tasks) first_stage = std::min(first_stage, task.stage);
    const auto ready = std::count_if(job.tasks.begin(), job.tasks.end(),
                                     [&](const NewTask& task) { return task.stage == first_stage; });
    LL_RETURN_IF_ERROR(db_->run("INSERT INTO progress (job, priority, open_stage, tasks, ready)"
                                " VALUES (?1, ?2, ?3, ?4, ?5)",
                                id, job.priority, first_stage, static_cast<int64_t>(job.tasks.size()), ready)
                           .status());
    LL_RETURN_IF_ERROR(record(id, now_ms, 0, "", "submitted"));
    LL_RETURN_IF_ERROR(reuse(id, now_ms));
    LL_RETURN_IF_ERROR(advance(id, now_ms));
    LL_RETURN_IF_ERROR(transaction.commit());
    return read_job(id);
  }

  absl::Status cancel(JobId job, int64_t now_ms) override {
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(const JobState state, state_of(job));
    if (state != JobState::kRunning) return absl::OkStatus();
    LL_RETURN_IF_ERROR(db_->run("UPDATE attempts SET state = ?2 WHERE state = 0 AND task IN"
                                " (SELECT id FROM tasks INDEXED BY tasks_live WHERE job = ?1 AND live > 0)",
                                job, number(AttemptState::kCancelled))
                           .status());
    LL_RETURN_IF_ERROR(
        db_->run("UPDATE tasks INDEXED BY tasks_live SET live = 0 WHERE job = ?1 AND live > 0", job).status());
    LL_RETURN_IF_ERROR(record(job, now_ms, 0, "", "cancelled"));
    LL_RETURN_IF_ERROR(end(job, JobState::kCancelled, now_ms));
    return transaction.commit();
  }

  absl::Status set_priority(JobId job, int32_t priority) override {
    const std::lock_guard guard(mutex_);
    LL_RETURN_IF_ERROR(state_of(job).status());
    return db_
        ->run("UPDATE progress SET priority = ?2, revision = revision + 1 WHERE job = ?1 AND priority != ?2", job,
              priority)
        .status();
  }

  absl::StatusOr<bool> lease(const NewLease& lease, int64_t now_ms) override {
    if (lease.token.empty() || lease.worker.empty()) {
      return absl::InvalidArgumentError("a lease needs the worker's name and a token of its own: give both");
    }
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(const Attempt used, find_attempt(lease.token));
    if (used.id != 0) {
      return absl::AlreadyExistsError(absl::StrCat("the token '", printable(lease.token),
                                                   "' already names an attempt at ", "task ", used.task,
                                                   ": make a new one per lease"));
    }
    LL_ASSIGN_OR_RETURN(
        const int64_t leased,
        db_->run("INSERT INTO attempts (task, token, worker, leased_ms, expires_ms)"
                 " SELECT t.id, ?2, ?3, ?4, ?5 FROM tasks t JOIN progress p ON p.job = t.job"
                 " WHERE t.id = ?1 AND t.state = 0 AND t.stage = p.open_stage AND p.state = 0 AND t.live < ?6"
                 " AND NOT EXISTS (SELECT 1 FROM attempts a WHERE a.task = t.id AND a.state = 0 AND a.worker = ?3)",
                 lease.task, lease.token, lease.worker, now_ms, lease.expires_ms, lease.max_live));
    if (leased == 0) return false;

    LL_RETURN_IF_ERROR(db_->run("UPDATE tasks SET live = live + 1 WHERE id = ?1", lease.task).status());
    LL_ASSIGN_OR_RETURN(const TaskRow task, find_task(lease.task));
    LL_RETURN_IF_ERROR(count(task.job, task.live == 1 ? Counts{.ready = -1, .running = 1} : Counts{}));
    LL_RETURN_IF_ERROR(record(task.job, now_ms, lease.task, lease.worker, "leased"));
    LL_RETURN_IF_ERROR(transaction.commit());
    return true;
  }

  absl::StatusOr<std::vector<std::string>> extend(const std::string& worker, const std::vector<std::string>& tokens,
                                                  int64_t expires_ms) override {
    std::vector<std::string> kept;
    if (tokens.empty()) return kept;
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    for (const std::string& token : tokens) {
      LL_ASSIGN_OR_RETURN(const int64_t extended,
                          db_->run("UPDATE attempts SET expires_ms = ?3 WHERE token = ?1 AND worker = ?2 AND state = 0",
                                   token, worker, expires_ms));
      if (extended > 0) kept.push_back(token);
    }
    LL_RETURN_IF_ERROR(transaction.commit());
    return kept;
  }

  absl::Status release(const std::string& worker, const std::vector<std::string>& tokens, int64_t now_ms) override {
    if (tokens.empty()) return absl::OkStatus();
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    for (const std::string& token : tokens) {
      LL_ASSIGN_OR_RETURN(const Attempt attempt, find_attempt(token));
      if (attempt.state != AttemptState::kLive || attempt.worker != worker) continue;
      LL_ASSIGN_OR_RETURN(const JobId job, give_up(attempt, AttemptState::kReleased));
      LL_RETURN_IF_ERROR(record(job, now_ms, attempt.task, worker, "released"));
    }
    return transaction.commit();
  }

  absl::StatusOr<std::vector<std::string>> expire(int64_t now_ms) override {
    std::vector<std::string> tokens;
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    {
      Query late = db_->query(
          "SELECT token FROM attempts INDEXED BY attempts_expiring WHERE state = 0 AND expires_ms < ?1"
          " ORDER BY expires_ms, id",
          now_ms);
      for (;;) {
        LL_ASSIGN_OR_RETURN(const bool row, late.step());
        if (!row) break;
        tokens.push_back(late.bytes(0));
      }
    }
    if (tokens.empty()) return tokens;
    for (const std::string& token : tokens) {
      LL_ASSIGN_OR_RETURN(const Attempt attempt, find_attempt(token));
      LL_ASSIGN_OR_RETURN(const JobId job, give_up(attempt, AttemptState::kExpired));
      LL_RETURN_IF_ERROR(record(job, now_ms, attempt.task, attempt.worker, "expired"));
    }
    LL_RETURN_IF_ERROR(transaction.commit());
    return tokens;
  }

  absl::Status renew_all(int64_t expires_ms) override {
    const std::lock_guard guard(mutex_);
    return db_->run("UPDATE attempts SET expires_ms = ?1 WHERE state = 0", expires_ms).status();
  }

  absl::StatusOr<Completion> complete(const std::string& token, const std::vector<Digest>& outputs,
                                      const std::vector<NewTask>& spawned, int64_t now_ms) override {
    const std::string packed = pack(outputs);
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(const Attempt attempt, find_attempt(token));
    if (attempt.id == 0) return Completion::kUnknown;
    LL_ASSIGN_OR_RETURN(const TaskRow task, find_task(attempt.task));
    if (task.state == StoredTask::kDone) {
      if (task.outputs == packed) return Completion::kAlreadyDone;
      if (attempt.state != AttemptState::kMismatched) {
        LL_RETURN_IF_ERROR(set_attempt(attempt.id, AttemptState::kMismatched));
        LL_RETURN_IF_ERROR(count(task.job, {}));
        LL_RETURN_IF_ERROR(record(task.job, now_ms, task.id, attempt.worker, "mismatch"));
        LL_RETURN_IF_ERROR(transaction.commit());
      }
      return Completion::kMismatch;
    }
    LL_ASSIGN_OR_RETURN(const JobState job_state, state_of(task.job));
    if (job_state != JobState::kRunning) return Completion::kJobEnded;
    LL_RETURN_IF_ERROR(check_spawned(task, spawned));

    // The attempt need not be live: results are pure functions of the task, so one that comes late is not wrong, and
    // one that comes after other attempts failed shows that the task can be done.
    LL_RETURN_IF_ERROR(set_attempt(attempt.id, AttemptState::kCompleted));
    LL_RETURN_IF_ERROR(end_attempts(task.id));
    LL_RETURN_IF_ERROR(db_->run("UPDATE tasks SET state = ?2, live = 0, outputs = ?3, error = '' WHERE id = ?1",
                                task.id, number(StoredTask::kDone), Blob{packed})
                           .status());
    Counts change{.done = 1};
    (task.state == StoredTask::kFailed ? change.failed : task.live > 0 ? change.running : change.ready) = -1;
    LL_RETURN_IF_ERROR(count(task.job, change));
    LL_ASSIGN_OR_RETURN(const std::string work, work_of_job(task.job));
    LL_RETURN_IF_ERROR(insert_tasks(task.job, work, spawned, task.id));
    LL_RETURN_IF_ERROR(add_tasks(task.job, static_cast<int64_t>(spawned.size())));
    LL_RETURN_IF_ERROR(record(task.job, now_ms, task.id, attempt.worker, "completed"));
    LL_RETURN_IF_ERROR(advance(task.job, now_ms));
    LL_RETURN_IF_ERROR(transaction.commit());
    return Completion::kAccepted;
  }

  absl::StatusOr<bool> fail(const std::string& token, const std::string& reason, int64_t now_ms,
                            uint32_t max_failures) override {
    const std::string kept = escape_controls(std::string_view(reason).substr(0, kMaxReason));
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(const Attempt attempt, find_attempt(token));
    if (attempt.id == 0 || attempt.state != AttemptState::kLive) return false;
    LL_ASSIGN_OR_RETURN(const JobId job, give_up(attempt, AttemptState::kFailed));
    LL_RETURN_IF_ERROR(
        db_->run("UPDATE tasks SET failures = failures + 1, error = ?2 WHERE id = ?1", attempt.task, kept).status());
    LL_RETURN_IF_ERROR(record(job, now_ms, attempt.task, attempt.worker, absl::StrCat("failed: ", kept)));

    LL_ASSIGN_OR_RETURN(const TaskRow task, find_task(attempt.task));
    if (task.failures >= max_failures) {
      LL_RETURN_IF_ERROR(end_attempts(task.id));
      LL_RETURN_IF_ERROR(
          db_->run("UPDATE tasks SET state = ?2, live = 0 WHERE id = ?1", task.id, number(StoredTask::kFailed))
              .status());
      Counts change{.failed = 1};
      (task.live > 0 ? change.running : change.ready) = -1;
      LL_RETURN_IF_ERROR(count(job, change));
      LL_RETURN_IF_ERROR(advance(job, now_ms));
    }
    LL_RETURN_IF_ERROR(transaction.commit());
    return true;
  }

  absl::StatusOr<std::vector<JobView>> view(uint32_t per_job_limit) override {
    const std::lock_guard guard(mutex_);
    std::vector<JobView> views;
    Query running = db_->query(
        "SELECT j.id, j.client, p.priority, p.open_stage FROM progress p INDEXED BY progress_running"
        " CROSS JOIN jobs j ON j.id = p.job WHERE p.state = 0 ORDER BY p.job");
    for (;;) {
      LL_ASSIGN_OR_RETURN(const bool row, running.step());
      if (!row) return views;
      JobView& view = views.emplace_back();
      view.id = running.integer(0);
      view.client = running.bytes(1);
      view.priority = static_cast<int32_t>(running.integer(2));
      LL_RETURN_IF_ERROR(view_ready(running.integer(3), per_job_limit, view));
      LL_RETURN_IF_ERROR(view_running(view));
    }
  }

  absl::StatusOr<std::vector<Job>> jobs(JobId after_id, uint32_t limit) override {
    const std::lock_guard guard(mutex_);
    std::vector<JobId> ids;
    {
      Query query = db_->query("SELECT id FROM jobs WHERE id > ?1 ORDER BY id LIMIT ?2", after_id, limit);
      for (;;) {
        LL_ASSIGN_OR_RETURN(const bool row, query.step());
        if (!row) break;
        ids.push_back(query.integer(0));
      }
    }
    std::vector<Job> jobs;
    jobs.reserve(ids.size());
    for (const JobId id : ids) {
      LL_ASSIGN_OR_RETURN(jobs.emplace_back(), read_job(id));
    }
    return jobs;
  }

  absl::StatusOr<Job> job(JobId id) override {
    const std::lock_guard guard(mutex_);
    return read_job(id);
  }

  absl::StatusOr<Task> task(TaskId id) override {
    const std::lock_guard guard(mutex_);
    Query query = db_->query(
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

  absl::StatusOr<std::vector<TaskOutputs>> outputs(JobId job, uint32_t stage) override {
    const std::lock_guard guard(mutex_);
    LL_RETURN_IF_ERROR(state_of(job).status());
    std::vector<TaskOutputs> all;
    Query query = db_->query(
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

  absl::StatusOr<std::vector<Event>> events(JobId job, int64_t after_id, uint32_t limit) override {
    const std::lock_guard guard(mutex_);
    LL_RETURN_IF_ERROR(state_of(job).status());
    std::vector<Event> events;
    Query query =
        db_->query("SELECT id, at_ms, task, worker, what FROM events WHERE job = ?1 AND id > ?2 ORDER BY id LIMIT ?3",
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

  absl::StatusOr<Forgotten> forget_ended(int64_t before_ms, uint32_t limit) override {
    const std::lock_guard guard(mutex_);
    return lightloom::forget_ended(*db_, before_ms, limit);
  }

  // These two read over connections of their own: no lock.
  absl::Status referenced(const VisitDigest& visit) override {
    LL_ASSIGN_OR_RETURN(const auto reader, open_sqlite_reader(db_->file().parent_path()));
    return visit_references(*reader, visit);
  }

  absl::StatusOr<std::vector<Digest>> references_of(const std::string& client) override {
    LL_ASSIGN_OR_RETURN(const auto reader, open_sqlite_reader(db_->file().parent_path()));
    return lightloom::references_of(*reader, client);
  }

 private:
  struct Attempt {
    int64_t id = 0;  // 0: there is none
    TaskId task = 0;
    std::string worker;
    AttemptState state = AttemptState::kLive;
  };

  struct TaskRow {
    TaskId id = 0;
    JobId job = 0;
    int64_t stage = 0;
    StoredTask state = StoredTask::kWaits;
    int64_t live = 0;
    int64_t failures = 0;
    std::string outputs;
  };

  absl::StatusOr<JobState> state_of(JobId job) {
    Query query = db_->query("SELECT state FROM progress WHERE job = ?1", job);
    LL_ASSIGN_OR_RETURN(const bool found, query.step());
    if (!found) return no_job(job);
    return static_cast<JobState>(query.integer(0));
  }

  absl::StatusOr<Attempt> find_attempt(const std::string& token) {
    Query query = db_->query("SELECT id, task, worker, state FROM attempts WHERE token = ?1", token);
    LL_ASSIGN_OR_RETURN(const bool found, query.step());
    if (!found) return Attempt{};
    return Attempt{.id = query.integer(0),
                   .task = query.integer(1),
                   .worker = query.bytes(2),
                   .state = static_cast<AttemptState>(query.integer(3))};
  }

  absl::StatusOr<TaskRow> find_task(TaskId id) {
    Query query = db_->query("SELECT job, stage, state, live, failures, outputs FROM tasks WHERE id = ?1", id);
    LL_ASSIGN_OR_RETURN(const bool found, query.step());
    if (!found) return absl::DataLossError(absl::StrCat("task ", id, " is gone: restore the state from a backup"));
    return TaskRow{.id = id,
                   .job = query.integer(0),
                   .stage = query.integer(1),
                   .state = static_cast<StoredTask>(query.integer(2)),
                   .live = query.integer(3),
                   .failures = query.integer(4),
                   .outputs = query.bytes(5)};
  }

  absl::StatusOr<std::string> work_of_job(JobId job) {
    Query query = db_->query("SELECT work FROM jobs WHERE id = ?1", job);
    LL_RETURN_IF_ERROR(query.step().status());
    return query.bytes(0);
  }

  absl::Status insert_tasks(JobId job, std::string_view work, const std::vector<NewTask>& tasks, TaskId spawner) {
    for (const NewTask& task : tasks) {
      const std::string key = key_of(work, task);
      LL_RETURN_IF_ERROR(db_->run("INSERT INTO tasks (job, stage, ord, kind, argument, key, spawner)"
                                  " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
                                  job, task.stage, task.order, task.kind, Blob{task.argument}, Blob{key}, spawner)
                             .status());
    }
    return absl::OkStatus();
  }

  absl::Status add_tasks(JobId job, int64_t n) {
    return db_->run("UPDATE progress SET tasks = tasks + ?2 WHERE job = ?1", job, n).status();
  }

  /// Tasks of the open stage whose results are known get them, and what followed from them.
  /// REQUIRES: the stage has just opened: all its tasks are ready.
  absl::Status reuse(JobId job, int64_t now_ms) {
    std::vector<std::pair<TaskId, TaskId>> known;  // a task, and its twin that is done
    {
      // One twin each: results are pure functions of the key.
      Query query = db_->query(
          "SELECT t.id, (SELECT d.id FROM tasks d INDEXED BY tasks_results WHERE d.key = t.key AND d.state = 1"
          " AND NOT EXISTS (SELECT 1 FROM attempts a INDEXED BY attempts_by_task WHERE a.task = d.id AND a.state = ?2)"
          " LIMIT 1) AS twin FROM tasks t INDEXED BY tasks_idle JOIN progress p ON p.job = t.job"
          " WHERE t.job = ?1 AND t.stage = p.open_stage AND t.state = 0 AND t.live = 0 AND t.key != x''"
          " AND twin NOT NULL",
          job, number(AttemptState::kMismatched));
      for (;;) {
        LL_ASSIGN_OR_RETURN(const bool row, query.step());
        if (!row) break;
        known.emplace_back(query.integer(0), query.integer(1));
      }
    }
    if (there_) {
      for (auto& [task, twin] : known) {
        LL_ASSIGN_OR_RETURN(const TaskRow of, find_task(twin));
        if (!there_(unpack(of.outputs))) twin = 0;
      }
      std::erase_if(known, [](const auto& pair) { return pair.second == 0; });
    }
    for (const auto& [task, twin] : known) {
      LL_RETURN_IF_ERROR(db_->run("UPDATE tasks SET state = 1, outputs = (SELECT outputs FROM tasks WHERE id = ?2)"
                                  " WHERE id = ?1",
                                  task, twin)
                             .status());
      LL_ASSIGN_OR_RETURN(const int64_t spawned,
                          db_->run("INSERT INTO tasks (job, stage, ord, kind, argument, key, spawner)"
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
    return db_->run("UPDATE progress SET reused = reused + ?2 WHERE job = ?1", job, n).status();
  }

  static absl::Status check_spawned(const TaskRow& task, const std::vector<NewTask>& spawned) {
    for (const NewTask& next : spawned) {
      if (next.stage > task.stage) continue;
      return absl::InvalidArgumentError(absl::StrCat("task ", task.id, " of stage ", task.stage,
                                                     " spawned one of stage ", next.stage,
                                                     ": give it a stage above its own"));
    }
    return check_arguments(spawned);
  }

  absl::Status set_attempt(int64_t id, AttemptState state) {
    return db_->run("UPDATE attempts SET state = ?2 WHERE id = ?1", id, number(state)).status();
  }

  /// Ends the task's live attempts because it needs none any more. The caller sets tasks.live.
  absl::Status end_attempts(TaskId task) {
    return db_
        ->run("UPDATE attempts INDEXED BY attempts_live SET state = ?2 WHERE task = ?1 AND state = 0", task,
              number(AttemptState::kSuperseded))
        .status();
  }

  /// Ends one live attempt; its task waits on. Returns the task's job.
  absl::StatusOr<JobId> give_up(const Attempt& attempt, AttemptState state) {
    LL_RETURN_IF_ERROR(set_attempt(attempt.id, state));
    LL_RETURN_IF_ERROR(db_->run("UPDATE tasks SET live = live - 1 WHERE id = ?1", attempt.task).status());
    LL_ASSIGN_OR_RETURN(const TaskRow task, find_task(attempt.task));
    LL_RETURN_IF_ERROR(count(task.job, task.live == 0 ? Counts{.ready = 1, .running = -1} : Counts{}));
    return task.job;
  }

  /// The job changed, and maybe its counts.
  absl::Status count(JobId job, const Counts& change) {
    return db_
        ->run(
            "UPDATE progress SET ready = ready + ?2, running = running + ?3, done = done + ?4, failed = failed + ?5,"
            " revision = revision + 1 WHERE job = ?1",
            job, change.ready, change.running, change.done, change.failed)
        .status();
  }

  absl::Status record(JobId job, int64_t at_ms, TaskId task, std::string_view worker, std::string_view what) {
    return db_
        ->run("INSERT INTO events (job, at_ms, task, worker, what) VALUES (?1, ?2, ?3, ?4, ?5)", job, at_ms, task,
              worker, what)
        .status();
  }

  /// Opens the next stage or ends the job, as often as the open stage has nothing left to do.
  absl::Status advance(JobId job, int64_t now_ms) {
    for (;;) {
      int64_t failed = 0;
      int64_t blocked = 0;
      int64_t done = 0;
      {
        Query query = db_->query(
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
      LL_RETURN_IF_ERROR(db_->run("UPDATE progress SET open_stage = (SELECT MIN(stage) FROM tasks"
                                  " WHERE job = ?1 AND stage > open_stage) WHERE job = ?1",
                                  job)
                             .status());
      LL_RETURN_IF_ERROR(
          db_->run("UPDATE progress SET ready = (SELECT COUNT(*) FROM tasks WHERE job = ?1 AND stage = open_stage)"
                   " WHERE job = ?1",
                   job)
              .status());
      LL_RETURN_IF_ERROR(reuse(job, now_ms));
    }
  }

  /// REQUIRES: the job runs and has no live attempts.
  absl::Status end(JobId job, JobState state, int64_t now_ms) {
    std::string error;
    if (state == JobState::kPartial || state == JobState::kFailed) {
      Query query = db_->query(
          "SELECT id, kind, error FROM tasks INDEXED BY tasks_failed WHERE job = ?1 AND state = 2"
          " ORDER BY ord, id LIMIT 1",
          job);
      LL_ASSIGN_OR_RETURN(const bool found, query.step());
      if (found) error = absl::StrCat("task ", query.integer(0), " (", query.bytes(1), "): ", query.bytes(2));
    }
    LL_RETURN_IF_ERROR(db_->run("UPDATE progress SET state = ?2, ready = 0, running = 0, finished_ms = ?3, error = ?4,"
                                " revision = revision + 1 WHERE job = ?1",
                                job, number(state), now_ms, error)
                           .status());
    return record(job, now_ms, 0, "", absl::StrCat("ended: ", name_of(state)));
  }

  absl::Status view_ready(int64_t open_stage, uint32_t limit, JobView& view) {
    // INDEXED BY: without that index the statement does not compile, so it cannot silently become a scan.
    Query query = db_->query(
        "SELECT id, ord, failures FROM tasks INDEXED BY tasks_idle WHERE job = ?1 AND stage = ?2 AND state = 0 AND "
        "live = 0"
        " ORDER BY ord, id LIMIT ?3",
        view.id, open_stage, limit);
    for (;;) {
      LL_ASSIGN_OR_RETURN(const bool row, query.step());
      if (!row) return absl::OkStatus();
      JobView::Ready& task = view.ready.emplace_back();
      task.task = query.integer(0);
      task.order = query.integer(1);
      if (query.integer(2) > 0) {
        LL_ASSIGN_OR_RETURN(task.failed_by, who_failed(task.task));
      }
    }
  }

  absl::StatusOr<std::vector<std::string>> who_failed(TaskId task) {
    std::vector<std::string> workers;
    Query query = db_->query(
        "SELECT DISTINCT worker FROM attempts INDEXED BY attempts_by_task WHERE task = ?1 AND state = ?2"
        " ORDER BY worker",
        task, number(AttemptState::kFailed));
    for (;;) {
      LL_ASSIGN_OR_RETURN(const bool row, query.step());
      if (!row) return workers;
      workers.push_back(query.bytes(0));
    }
  }

  absl::Status view_running(JobView& view) {
    // CROSS JOIN: tasks first, then their attempts; one row per attempt.
    Query query = db_->query(
        "SELECT t.id, t.ord, a.leased_ms, a.worker FROM tasks t INDEXED BY tasks_live"
        " CROSS JOIN attempts a INDEXED BY attempts_live ON a.task = t.id AND a.state = 0"
        " WHERE t.job = ?1 AND t.live > 0 ORDER BY t.ord, t.id, a.id",
        view.id);
    for (;;) {
      LL_ASSIGN_OR_RETURN(const bool row, query.step());
      if (!row) return absl::OkStatus();
      if (view.running.empty() || view.running.back().task != query.integer(0)) {
        view.running.push_back(
            {.task = query.integer(0), .order = query.integer(1), .leased_ms = query.integer(2), .workers = {}});
      }
      JobView::Running& task = view.running.back();
      task.workers.push_back(query.bytes(3));
      task.leased_ms = std::min(task.leased_ms, query.integer(2));
      ++task.live;
      ++view.live;
    }
  }

  absl::StatusOr<Job> read_job(JobId id) {
    Job job;
    {
      Query query = db_->query(
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
    Query query = db_->query(
        "SELECT outputs FROM tasks WHERE job = ?1 AND stage = (SELECT MAX(stage) FROM tasks WHERE job = ?1)"
        " AND state = 1 ORDER BY ord, id",
        id);
    for (;;) {
      LL_ASSIGN_OR_RETURN(const bool row, query.step());
      if (!row) return job;
      for (const Digest& digest : unpack(query.bytes(0))) job.outputs.push_back(digest);
    }
  }

  const std::function<bool(const std::vector<Digest>&)> there_;
  FolderLock lock_;               // before the database: let go after the database is closed
  std::recursive_mutex mutex_;    // a group's calls hold it once more
  std::unique_ptr<Database> db_;  // guarded by mutex_
};

}  // namespace

absl::StatusOr<std::unique_ptr<Store>> open_sqlite_store(const fs::path& folder, Durability durability,
                                                         std::function<bool(const std::vector<Digest>&)> there) {
  auto store = std::make_unique<SqliteStore>(std::move(there));
  LL_RETURN_IF_ERROR(store->open(folder, durability));
  return store;
}

}  // namespace lightloom
