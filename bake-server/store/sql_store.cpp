#include "bake-server/store/sql_store.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <mutex>
#include <utility>

#include "bake-server/store/job_content.h"
#include "bake-server/store/job_progress.h"
#include "bake-server/store/job_reader.h"
#include "bake-server/store/packed_digests.h"
#include "bake-server/store/schema.h"
#include "bake-server/store/sql_upkeep.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

class SqlStore final : public Store {
 public:
  explicit SqlStore(SqlStoreParts parts)
      : held_(std::move(parts.held)),
        open_reader_(std::move(parts.open_reader)),
        db_(std::move(parts.database)),
        progress_(db_.get(), std::move(parts.there)) {}

  int64_t now_ms() override { return db_->now_ms(); }

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
      if (there) return read_job(*db_, same.integer(0));
    }
    if (admit) LL_RETURN_IF_ERROR(admit(job));

    const std::string work = work_of(job);
    LL_ASSIGN_OR_RETURN(const JobId id,
                        insert("INSERT INTO jobs (client, request_id, content, name, created_ms, inputs, payload, work)"
                               " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8) RETURNING id",
                               job.client, job.request_id, Blob{content}, job.name, now_ms, Blob{pack(job.inputs)},
                               Blob{job.payload}, Blob{work}));
    LL_RETURN_IF_ERROR(progress_.insert_tasks(id, work, job.tasks, 0));
    uint32_t first_stage = job.tasks[0].stage;
    for (const NewTask& task : job.tasks) first_stage = std::min(first_stage, task.stage);
    const auto ready = std::count_if(job.tasks.begin(), job.tasks.end(),
                                     [&](const NewTask& task) { return task.stage == first_stage; });
    LL_RETURN_IF_ERROR(
        db_->send("INSERT INTO progress (job, priority, open_stage, tasks, ready)"
                  " VALUES (?1, ?2, ?3, ?4, ?5)",
                  id, job.priority, first_stage, static_cast<int64_t>(job.tasks.size()), ready));
    LL_RETURN_IF_ERROR(progress_.record(id, now_ms, 0, "", "submitted"));
    LL_RETURN_IF_ERROR(progress_.reuse(id, now_ms));
    LL_RETURN_IF_ERROR(progress_.advance(id, now_ms));
    LL_RETURN_IF_ERROR(transaction.commit());
    return read_job(*db_, id);
  }

  absl::Status cancel(JobId job, int64_t now_ms) override {
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(const JobState state, state_of(*db_, job));
    if (state != JobState::kRunning) return absl::OkStatus();
    LL_RETURN_IF_ERROR(
        db_->send("UPDATE attempts SET state = ?2 WHERE state = 0 AND task IN"
                  " (SELECT id FROM tasks INDEXED BY tasks_live WHERE job = ?1 AND live > 0)",
                  job, number(AttemptState::kCancelled)));
    LL_RETURN_IF_ERROR(db_->send("UPDATE tasks INDEXED BY tasks_live SET live = 0 WHERE job = ?1 AND live > 0", job));
    LL_RETURN_IF_ERROR(progress_.record(job, now_ms, 0, "", "cancelled"));
    LL_RETURN_IF_ERROR(progress_.end(job, JobState::kCancelled, now_ms));
    return transaction.commit();
  }

  absl::Status set_priority(JobId job, int32_t priority) override {
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_RETURN_IF_ERROR(state_of(*db_, job).status());
    LL_RETURN_IF_ERROR(db_->send(
        "UPDATE progress SET priority = ?2, revision = revision + 1 WHERE job = ?1 AND priority != ?2", job, priority));
    return transaction.commit();
  }

  absl::StatusOr<bool> lease(const NewLease& lease, int64_t now_ms) override {
    if (lease.token.empty() || lease.worker.empty()) {
      return absl::InvalidArgumentError("a lease needs the worker's name and a token of its own: give both");
    }
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(
        const int64_t leased,
        db_->run("INSERT INTO attempts (task, token, worker, leased_ms, expires_ms)"
                 " SELECT t.id, ?2, ?3, ?4, ?5 FROM tasks t JOIN progress p ON p.job = t.job"
                 " WHERE t.id = ?1 AND t.state = 0 AND t.stage = p.open_stage AND p.state = 0 AND t.live < ?6"
                 " AND NOT EXISTS (SELECT 1 FROM attempts a WHERE a.task = t.id AND a.state = 0 AND a.worker = ?3)"
                 " AND NOT EXISTS (SELECT 1 FROM attempts a WHERE a.token = ?2)",
                 lease.task, lease.token, lease.worker, now_ms, lease.expires_ms, lease.max_live));
    if (leased == 0) {
      LL_ASSIGN_OR_RETURN(const Found used, find_attempt(lease.token));
      if (used.attempt.id == 0) return false;
      return absl::AlreadyExistsError(absl::StrCat("the token '", printable(lease.token),
                                                   "' already names an attempt at task ", used.attempt.task,
                                                   ": make a new one per lease"));
    }
    LL_ASSIGN_OR_RETURN(const TaskRow task, change_live(lease.task, 1));
    LL_RETURN_IF_ERROR(progress_.count(task.job, task.live == 1 ? Counts{.ready = -1, .running = 1} : Counts{}));
    LL_RETURN_IF_ERROR(progress_.record(task.job, now_ms, lease.task, lease.worker, "leased"));
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
      LL_ASSIGN_OR_RETURN(const Found found, find_attempt(token));
      const Attempt& attempt = found.attempt;
      if (attempt.state != AttemptState::kLive || attempt.worker != worker) continue;
      LL_ASSIGN_OR_RETURN(const TaskRow task, give_up(attempt, AttemptState::kReleased));
      LL_RETURN_IF_ERROR(progress_.record(task.job, now_ms, attempt.task, worker, "released"));
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
      LL_ASSIGN_OR_RETURN(const Found found, find_attempt(token));
      LL_ASSIGN_OR_RETURN(const TaskRow task, give_up(found.attempt, AttemptState::kExpired));
      LL_RETURN_IF_ERROR(progress_.record(task.job, now_ms, task.id, found.attempt.worker, "expired"));
    }
    LL_RETURN_IF_ERROR(transaction.commit());
    return tokens;
  }

  absl::Status renew_all(int64_t expires_ms) override {
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_RETURN_IF_ERROR(db_->send("UPDATE attempts SET expires_ms = ?1 WHERE state = 0", expires_ms));
    return transaction.commit();
  }

  absl::StatusOr<Completion> complete(const std::string& token, const std::vector<Digest>& outputs,
                                      const std::vector<NewTask>& spawned, int64_t now_ms) override {
    const std::string packed = pack(outputs);
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(const Found found, find_attempt(token));
    const auto& [attempt, task, job_state] = found;
    if (attempt.id == 0) return Completion::kUnknown;
    if (task.state == StoredTask::kDone) {
      if (task.outputs == packed) return Completion::kAlreadyDone;
      if (attempt.state != AttemptState::kMismatched) {
        LL_RETURN_IF_ERROR(set_attempt(attempt.id, AttemptState::kMismatched));
        LL_RETURN_IF_ERROR(progress_.count(task.job, {}));
        LL_RETURN_IF_ERROR(progress_.record(task.job, now_ms, task.id, attempt.worker, "mismatch"));
        LL_RETURN_IF_ERROR(transaction.commit());
      }
      return Completion::kMismatch;
    }
    if (job_state != JobState::kRunning) return Completion::kJobEnded;
    LL_RETURN_IF_ERROR(check_spawned(task, spawned));

    // The attempt need not be live: results are pure functions of the task, so one that comes late is not wrong, and
    // one that comes after other attempts failed shows that the task can be done.
    LL_RETURN_IF_ERROR(set_attempt(attempt.id, AttemptState::kCompleted));
    LL_RETURN_IF_ERROR(end_attempts(task.id));
    LL_RETURN_IF_ERROR(db_->send("UPDATE tasks SET state = ?2, live = 0, outputs = ?3, error = '' WHERE id = ?1",
                                 task.id, number(StoredTask::kDone), Blob{packed}));
    Counts change{.done = 1};
    (task.state == StoredTask::kFailed ? change.failed : task.live > 0 ? change.running : change.ready) = -1;
    LL_RETURN_IF_ERROR(progress_.count(task.job, change));
    if (!spawned.empty()) {
      LL_ASSIGN_OR_RETURN(const std::string work, work_of_job(task.job));
      LL_RETURN_IF_ERROR(progress_.insert_tasks(task.job, work, spawned, task.id));
      LL_RETURN_IF_ERROR(progress_.add_tasks(task.job, static_cast<int64_t>(spawned.size())));
    }
    LL_RETURN_IF_ERROR(progress_.record(task.job, now_ms, task.id, attempt.worker, "completed"));
    LL_RETURN_IF_ERROR(progress_.advance(task.job, now_ms));
    LL_RETURN_IF_ERROR(transaction.commit());
    return Completion::kAccepted;
  }

  absl::StatusOr<bool> fail(const std::string& token, const std::string& reason, int64_t now_ms,
                            uint32_t max_failures) override {
    const std::string kept = escape_controls(std::string_view(reason).substr(0, kMaxReason));
    const std::lock_guard guard(mutex_);
    Transaction transaction(*db_);
    LL_RETURN_IF_ERROR(transaction.begin());
    LL_ASSIGN_OR_RETURN(const Found found, find_attempt(token));
    const Attempt& attempt = found.attempt;
    if (attempt.id == 0 || attempt.state != AttemptState::kLive) return false;
    LL_ASSIGN_OR_RETURN(const TaskRow task, give_up(attempt, AttemptState::kFailed));
    const JobId job = task.job;
    LL_RETURN_IF_ERROR(
        db_->send("UPDATE tasks SET failures = failures + 1, error = ?2 WHERE id = ?1", attempt.task, kept));
    LL_RETURN_IF_ERROR(progress_.record(job, now_ms, attempt.task, attempt.worker, absl::StrCat("failed: ", kept)));

    if (task.failures + 1 >= max_failures) {
      LL_RETURN_IF_ERROR(end_attempts(task.id));
      LL_RETURN_IF_ERROR(
          db_->send("UPDATE tasks SET state = ?2, live = 0 WHERE id = ?1", task.id, number(StoredTask::kFailed)));
      Counts change{.failed = 1};
      (task.live > 0 ? change.running : change.ready) = -1;
      LL_RETURN_IF_ERROR(progress_.count(job, change));
      LL_RETURN_IF_ERROR(progress_.advance(job, now_ms));
    }
    LL_RETURN_IF_ERROR(transaction.commit());
    return true;
  }

  absl::StatusOr<std::vector<JobView>> view(uint32_t per_job_limit) override {
    const std::lock_guard guard(mutex_);
    return read_view(*db_, per_job_limit);
  }

  absl::StatusOr<std::vector<Job>> jobs(JobId after_id, uint32_t limit) override {
    const std::lock_guard guard(mutex_);
    return read_jobs(*db_, after_id, limit);
  }

  absl::StatusOr<Job> job(JobId id) override {
    const std::lock_guard guard(mutex_);
    return read_job(*db_, id);
  }

  absl::StatusOr<Task> task(TaskId id) override {
    const std::lock_guard guard(mutex_);
    return read_task(*db_, id);
  }

  absl::StatusOr<std::vector<TaskOutputs>> outputs(JobId job, uint32_t stage) override {
    const std::lock_guard guard(mutex_);
    return read_outputs(*db_, job, stage);
  }

  absl::StatusOr<std::vector<Event>> events(JobId job, int64_t after_id, uint32_t limit) override {
    const std::lock_guard guard(mutex_);
    return read_events(*db_, job, after_id, limit);
  }

  absl::StatusOr<Forgotten> forget_ended(int64_t before_ms, uint32_t limit) override {
    const std::lock_guard guard(mutex_);
    return lightloom::forget_ended(*db_, before_ms, limit);
  }

  // These two read over connections of their own: no lock.
  absl::Status referenced(const VisitDigest& visit) override {
    LL_ASSIGN_OR_RETURN(const auto reader, open_reader_());
    return visit_references(*reader, visit);
  }

  absl::StatusOr<std::vector<Digest>> references_of(const std::string& client) override {
    LL_ASSIGN_OR_RETURN(const auto reader, open_reader_());
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

  struct Found {
    Attempt attempt;
    TaskRow task;
    JobState job = JobState::kRunning;
  };

  /// Returns the id of the row.
  template <class... Args>
  absl::StatusOr<int64_t> insert(const char* sql, const Args&... args) {
    Query made = db_->query(sql, args...);
    LL_RETURN_IF_ERROR(made.step().status());
    const int64_t id = made.integer(0);
    LL_RETURN_IF_ERROR(made.step().status());
    return id;
  }

  /// The attempt and all that decides what becomes of it, in one round trip.
  absl::StatusOr<Found> find_attempt(const std::string& token) {
    Query query = db_->query(
        "SELECT a.id, a.task, a.worker, a.state, t.job, t.stage, t.state, t.live, t.failures, t.outputs, p.state"
        " FROM attempts a JOIN tasks t ON t.id = a.task JOIN progress p ON p.job = t.job WHERE a.token = ?1",
        token);
    LL_ASSIGN_OR_RETURN(const bool found, query.step());
    if (!found) return Found{};
    return Found{.attempt = {.id = query.integer(0),
                             .task = query.integer(1),
                             .worker = query.bytes(2),
                             .state = static_cast<AttemptState>(query.integer(3))},
                 .task = {.id = query.integer(1),
                          .job = query.integer(4),
                          .stage = query.integer(5),
                          .state = static_cast<StoredTask>(query.integer(6)),
                          .live = query.integer(7),
                          .failures = query.integer(8),
                          .outputs = query.bytes(9)},
                 .job = static_cast<JobState>(query.integer(10))};
  }

  /// The task as it is with so many more live attempts.
  absl::StatusOr<TaskRow> change_live(TaskId id, int64_t by) {
    Query query = db_->query(
        "UPDATE tasks SET live = live + ?2 WHERE id = ?1 RETURNING job, stage, state, live, failures", id, by);
    LL_ASSIGN_OR_RETURN(const bool found, query.step());
    if (!found) return absl::DataLossError(absl::StrCat("task ", id, " is gone: restore the state from a backup"));
    TaskRow row{.id = id,
                .job = query.integer(0),
                .stage = query.integer(1),
                .state = static_cast<StoredTask>(query.integer(2)),
                .live = query.integer(3),
                .failures = query.integer(4),
                .outputs = {}};
    LL_RETURN_IF_ERROR(query.step().status());
    return row;
  }

  absl::StatusOr<std::string> work_of_job(JobId job) {
    Query query = db_->query("SELECT work FROM jobs WHERE id = ?1", job);
    LL_RETURN_IF_ERROR(query.step().status());
    return query.bytes(0);
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
    return db_->send("UPDATE attempts SET state = ?2 WHERE id = ?1", id, number(state));
  }

  /// Ends the task's live attempts because it needs none any more. The caller sets tasks.live.
  absl::Status end_attempts(TaskId task) {
    return db_->send("UPDATE attempts INDEXED BY attempts_live SET state = ?2 WHERE task = ?1 AND state = 0", task,
                     number(AttemptState::kSuperseded));
  }

  /// Ends one live attempt; its task, which is returned, waits on.
  absl::StatusOr<TaskRow> give_up(const Attempt& attempt, AttemptState state) {
    LL_RETURN_IF_ERROR(set_attempt(attempt.id, state));
    LL_ASSIGN_OR_RETURN(TaskRow task, change_live(attempt.task, -1));
    LL_RETURN_IF_ERROR(progress_.count(task.job, task.live == 0 ? Counts{.ready = 1, .running = -1} : Counts{}));
    return task;
  }

  const std::shared_ptr<void> held_;  // before the database: let go after it is closed
  const std::function<absl::StatusOr<std::unique_ptr<Database>>()> open_reader_;
  std::recursive_mutex mutex_;          // a group's calls hold it once more
  const std::unique_ptr<Database> db_;  // guarded by mutex_
  JobProgress progress_;                // so is this
};

}  // namespace

std::unique_ptr<Store> make_sql_store(SqlStoreParts parts) { return std::make_unique<SqlStore>(std::move(parts)); }

}  // namespace lightloom
