// What the coordinator spends on a task beside the least that SQLite must do for it: the rows that lease it and put its
// result on record, written by prepared statements, in the same groups, on the same tables. Nothing waits for the disk.
#include <sqlite3.h>

#include <memory>
#include <string>
#include <vector>

#include "bake-server/scheduler/decide.h"
#include "tests/bench/or_exit.h"
#include "tests/bench/ratios/ratio.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::bench {
namespace {

using test::TemporaryFolder;

constexpr int kTasks = 32'768;  // of the job
constexpr int kTogether = 32;   // that one commit leases, and one puts on record
constexpr int kTurn = 512;      // that a turn does
constexpr int64_t kNow = 10, kExpires = 100;
const std::string kWorker = "worker";

std::string token(TaskId task) { return absl::StrCat("attempt at ", task); }

std::unique_ptr<Store> store_with_job(const TemporaryFolder& folder) {
  auto store = or_exit(open_sqlite_store(folder.path(), Durability::kProcess));
  std::vector<NewTask> tasks;
  for (int i = 0; i < kTasks; ++i) tasks.push_back(test::cell(0, i));
  or_exit(store->submit(test::new_job("request", std::move(tasks)), kNow));
  return store;
}

/// The same, closed again.
const TemporaryFolder& with_job(const TemporaryFolder& folder) {
  store_with_job(folder);
  return folder;
}

/// A connection to the database of a store.
class Connection {
 public:
  explicit Connection(const TemporaryFolder& folder) {
    check(sqlite3_open((folder.path() / "store.db").c_str(), &db_));
  }
  ~Connection() { sqlite3_close(db_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  sqlite3* get() const { return db_; }
  void check(int code) const {
    or_exit(code == SQLITE_OK || code == SQLITE_DONE ? absl::OkStatus() : absl::InternalError(sqlite3_errmsg(db_)));
  }
  void run(const char* sql) const { check(sqlite3_exec(db_, sql, nullptr, nullptr, nullptr)); }

 private:
  sqlite3* db_ = nullptr;
};

/// All that the tables hold which change with a task.
std::string rows_of(const TemporaryFolder& folder) {
  const Connection db(folder);
  std::string out;
  const auto append = [](void* to, int columns, char** values, char**) {
    for (int c = 0; c < columns; ++c) static_cast<std::string*>(to)->append(values[c]).append(" ");
    return 0;
  };
  for (const char* const table : {"tasks", "attempts", "progress", "events"}) {
    const std::string all = absl::StrCat("SELECT * FROM ", table, " ORDER BY rowid");
    db.check(sqlite3_exec(db.get(), all.c_str(), append, &out, nullptr));
  }
  return out;
}

/// The store's rows, and no more.
class BareSqlite {
 public:
  /// In a folder of its own, with the job.
  BareSqlite() : db_(with_job(folder_)) {
    db_.run("PRAGMA foreign_keys=ON");
    db_.run("PRAGMA synchronous=OFF");
    for (const char* const sql :
         {"INSERT INTO attempts (task, token, worker, leased_ms, expires_ms) VALUES (?1, ?2, ?3, ?4, ?5)",
          "UPDATE tasks SET live = 1 WHERE id = ?1",
          "UPDATE progress SET ready = ready - 1, running = running + 1, revision = revision + 1 WHERE job = 1",
          "INSERT INTO events (job, at_ms, task, worker, what) VALUES (1, ?4, ?1, ?3, 'leased')"}) {
      prepare(sql, &lease_);
    }
    for (const char* const sql :
         {"UPDATE attempts SET state = 1 WHERE token = ?2",
          "UPDATE tasks SET state = 1, live = 0, outputs = ?6 WHERE id = ?1",
          "UPDATE progress SET running = running - 1, done = done + 1, revision = revision + 1 WHERE job = 1",
          "INSERT INTO events (job, at_ms, task, worker, what) VALUES (1, ?4, ?1, ?3, 'completed')"}) {
      prepare(sql, &complete_);
    }
  }
  ~BareSqlite() {
    for (const auto* statements : {&lease_, &complete_}) {
      for (sqlite3_stmt* const s : *statements) sqlite3_finalize(s);
    }
  }
  BareSqlite(const BareSqlite&) = delete;
  BareSqlite& operator=(const BareSqlite&) = delete;

  /// Leases and completes tasks `first` and the kTurn - 1 behind it.
  void do_tasks(TaskId first) {
    for (TaskId group = first; group < first + kTurn; group += kTogether) {
      for (const auto* statements : {&lease_, &complete_}) {
        db_.run("BEGIN IMMEDIATE");
        for (TaskId task = group; task < group + kTogether; ++task) {
          const std::string name = token(task);
          const Digest output = test::digest(task);
          for (sqlite3_stmt* const s : *statements) step(s, task, name, output);
        }
        db_.run("COMMIT");
      }
    }
  }
  const TemporaryFolder& folder() const { return folder_; }

 private:
  void prepare(const char* sql, std::vector<sqlite3_stmt*>* to) const {
    db_.check(sqlite3_prepare_v3(db_.get(), sql, -1, SQLITE_PREPARE_PERSISTENT, &to->emplace_back(), nullptr));
  }
  /// Binds as many parameters as the statement has.
  void step(sqlite3_stmt* s, TaskId task, const std::string& name, const Digest& output) const {
    const int parameters = sqlite3_bind_parameter_count(s);
    if (parameters >= 1) sqlite3_bind_int64(s, 1, task);
    if (parameters >= 2) sqlite3_bind_text(s, 2, name.data(), static_cast<int>(name.size()), SQLITE_STATIC);
    if (parameters >= 3) sqlite3_bind_text(s, 3, kWorker.data(), static_cast<int>(kWorker.size()), SQLITE_STATIC);
    if (parameters >= 4) sqlite3_bind_int64(s, 4, kNow);
    if (parameters >= 5) sqlite3_bind_int64(s, 5, kExpires);
    if (parameters >= 6) sqlite3_bind_blob(s, 6, output.bytes.data(), sizeof output.bytes, SQLITE_STATIC);
    db_.check(sqlite3_step(s));
    db_.check(sqlite3_reset(s));
  }

  const TemporaryFolder folder_;
  const Connection db_;
  std::vector<sqlite3_stmt*> lease_, complete_;
};

/// The same by the store.
void do_tasks(Store* store, TaskId first) {
  for (TaskId group = first; group < first + kTurn; group += kTogether) {
    or_exit(store->group([&]() -> absl::Status {
      for (TaskId task = group; task < group + kTogether; ++task) {
        LL_RETURN_IF_ERROR(store->lease({task, kWorker, token(task), kExpires}, kNow).status());
      }
      return absl::OkStatus();
    }));
    or_exit(store->group([&]() -> absl::Status {
      for (TaskId task = group; task < group + kTogether; ++task) {
        LL_RETURN_IF_ERROR(store->complete(token(task), {test::digest(task)}, {}, kNow).status());
      }
      return absl::OkStatus();
    }));
  }
}

/// A store and its bare twin, whose rows were compared.
struct Twins {
  Twins() {
    do_tasks(store.get(), next);
    bare.do_tasks(next);
    next += kTurn;
    or_exit(
        rows_of(folder) == rows_of(bare.folder())
            ? absl::OkStatus()
            : absl::InternalError("the bare loop writes other rows than the store; mend tests/bench/ratios/farm.cpp"));
  }

  TemporaryFolder folder;
  std::unique_ptr<Store> store = store_with_job(folder);
  BareSqlite bare;
  TaskId next = 1;
};

void store(benchmark::State& state) {
  static Twins twins;
  Ratio ratio(&state, "bare SQLite, the same rows");
  for ([[maybe_unused]] auto _ : state) {
    ratio.turn([&] { twins.bare.do_tasks(twins.next); }, [&] { do_tasks(twins.store.get(), twins.next); });
    twins.next += kTurn;
  }
}
BENCHMARK(store)->UseManualTime()->Iterations(4);

/// Two jobs with what the store shows of them, and eight workers that take four tasks each.
void decide(benchmark::State& state) {
  static BareSqlite bare;
  static TaskId next = 1;
  constexpr uint32_t kReady = 256, kWorkers = 8, kRoom = kTogether / kWorkers;
  constexpr int kTimes = 16;  // decided as often: it takes so little
  std::vector<JobView> jobs(2);
  for (size_t j = 0; j < jobs.size(); ++j) {
    jobs[j].id = static_cast<JobId>(j + 1);
    jobs[j].client = absl::StrCat("client ", j);
    for (uint32_t i = 0; i < kReady; ++i) jobs[j].ready.push_back({static_cast<TaskId>(1000 * j + i + 1), i});
  }
  std::vector<Demand> demands;
  for (uint32_t w = 0; w < kWorkers; ++w) demands.push_back({absl::StrCat("worker ", w), kRoom, 0, 0, kRoom});

  Ratio ratio(&state, "bare SQLite, the rows of as many tasks");
  for ([[maybe_unused]] auto _ : state) {
    std::vector<std::vector<JobView>> views(kTimes * kTurn / kTogether, jobs);
    const double start = cpu_milliseconds();
    bare.do_tasks(next);
    const double middle = cpu_milliseconds();
    for (auto& view : views) {
      const auto decisions = lightloom::decide(std::move(view), demands, kNow);
      if (decisions.size() != kTogether) state.SkipWithError("not every demand was met");
    }
    ratio.add((cpu_milliseconds() - middle) / kTimes, middle - start);
    next += kTurn;
  }
}
BENCHMARK(decide)->UseManualTime()->Iterations(2);

}  // namespace
}  // namespace lightloom::bench
