// What is SQLite's own: its folder, its file, its limits. The contract: store_test.cpp.
#include "bake-server/store/sqlite_store.h"

#include <absl/strings/str_cat.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>

#include <filesystem>
#include <fstream>
#include <functional>

#include "tests/support/previous_schema.h"
#include "tests/unit/bake-server/store_fixture.h"

namespace lightloom::test {
namespace {

namespace fs = std::filesystem;
using testing::HasSubstr;
using testing::Not;

/// The connection that was opened last.
sqlite3* connection = nullptr;

int note_connection(sqlite3* opened, const char** /*error*/, const void* /*api*/) {
  connection = opened;
  return SQLITE_OK;
}

class SqliteStoreTest : public testing::Test {
 protected:
  static void SetUpTestSuite() { sqlite3_auto_extension(reinterpret_cast<void (*)()>(&note_connection)); }
  static void TearDownTestSuite() { sqlite3_reset_auto_extension(); }

  absl::Status open_error() {
    absl::Status status = open_sqlite_store(folder_.path()).status();
    EXPECT_THAT(std::string(status.message()), Not(HasSubstr("\n")));
    return status;
  }

  void execute(const char* sql) {
    sqlite3* db = nullptr;
    ASSERT_EQ(sqlite3_open((folder_.path() / "store.db").c_str(), &db), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(db, sql, nullptr, nullptr, nullptr), SQLITE_OK) << sqlite3_errmsg(db);
    sqlite3_close(db);
  }

  TemporaryFolder folder_;
};

TEST_F(SqliteStoreTest, ASecondServerIsRefused) {
  auto first = open_sqlite_store(folder_.path());
  ASSERT_TRUE(first.ok()) << first.status();
  const absl::Status status = open_error();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(folder_.path().string()));
  first->reset();
  EXPECT_TRUE(open_sqlite_store(folder_.path()).ok());
}

TEST_F(SqliteStoreTest, MakesTheFolderAndThoseAboveIt) {
  EXPECT_TRUE(open_sqlite_store(folder_.path() / "a" / "b").ok());
  EXPECT_TRUE(fs::exists(folder_.path() / "a" / "b" / "store.db"));
}

TEST_F(SqliteStoreTest, CommitsReachTheDiskAtOnce) {
  auto store = value(open_sqlite_store(folder_.path()));
  std::string mode;
  const auto note = [](void* into, int, char** columns, char**) {
    *static_cast<std::string*>(into) += absl::StrCat(columns[0], " ");
    return 0;
  };
  sqlite3_exec(connection, "PRAGMA journal_mode; PRAGMA synchronous; PRAGMA foreign_keys", note, &mode, nullptr);
  EXPECT_EQ(mode, "wal 2 1 ");
}

TEST_F(SqliteStoreTest, WhatWasReportedSurvivesACrash) {
  auto store = value(open_sqlite_store(folder_.path()));
  const Job job = value(store->submit(new_job("r", {cell(0, 0)}), 1));
  ASSERT_TRUE(value(store->lease({1, "w", "t", 100, 1}, 10)));
  ASSERT_EQ(value(store->complete("t", {digest(1)}, {}, 20)), Completion::kAccepted);
  const TemporaryFolder after;  // what the disk would show if the process ended now
  for (const char* name : {"store.db", "store.db-wal"}) fs::copy(folder_.path() / name, after.path() / name);
  auto survivor = value(open_sqlite_store(after.path()));
  EXPECT_EQ(value(survivor->job(job.id)).state, JobState::kDone);
  EXPECT_EQ(value(survivor->complete("t", {digest(1)}, {}, 30)), Completion::kAlreadyDone);
}

TEST_F(SqliteStoreTest, ANewerSchemaIsRefused) {
  value(open_sqlite_store(folder_.path())).reset();
  execute("PRAGMA user_version = 3");
  const absl::Status status = open_error();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("schema version 3, this server knows up to 2"));
  execute("PRAGMA user_version = 2");
  EXPECT_TRUE(open_sqlite_store(folder_.path()).ok());
}

TEST_F(SqliteStoreTest, OutputsThatAreGoneAreNotUsedAgain) {
  bool there = true;
  const auto store = value(open_sqlite_store(folder_.path(), Durability::kProcess, [&](const auto& outputs) {
    EXPECT_EQ(outputs, std::vector{digest(1)});
    return there;
  }));
  value(store->submit(new_job("r", {cell(0, 0)}), 1));
  EXPECT_TRUE(value(store->lease({1, "w", "a", 100, 1}, 10)));
  EXPECT_EQ(value(store->complete("a", {digest(1)}, {}, 20)), Completion::kAccepted);
  EXPECT_EQ(value(store->submit(new_job("s", {cell(0, 0)}), 30)).state, JobState::kDone);
  there = false;
  EXPECT_EQ(value(store->submit(new_job("t", {cell(0, 0)}), 40)).state, JobState::kRunning);
}

TEST_F(SqliteStoreTest, TheSchemaBeforeIsBroughtUp) {
  auto store = value(open_sqlite_store(folder_.path()));
  const JobId old = value(store->submit(new_job("r", {cell(0, 0), cell(1, 1)}), 1)).id;
  EXPECT_TRUE(value(store->lease({1, "w", "a", 100, 1}, 10)));
  EXPECT_EQ(value(store->complete("a", {digest(1)}, {}, 20)), Completion::kAccepted);
  EXPECT_TRUE(value(store->lease({2, "w", "b", 100, 1}, 10)));
  store.reset();
  for (const char* sql : kBackToSchema1) execute(sql);
  store = value(open_sqlite_store(folder_.path()));
  EXPECT_EQ(value(store->complete("b", {digest(2)}, {}, 30)), Completion::kAccepted);
  EXPECT_EQ(value(store->job(old)).state, JobState::kDone);
  EXPECT_EQ(value(store->submit(new_job("s", {cell(0, 0), cell(1, 1)}), 40)).done, 0u) << "of which nothing is known";
}

TEST_F(SqliteStoreTest, SomebodyElsesDatabaseIsRefused) {
  execute("CREATE TABLE recipes (name TEXT)");
  const absl::Status status = open_error();
  EXPECT_EQ(status.code(), absl::StatusCode::kFailedPrecondition) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("something else"));
}

TEST_F(SqliteStoreTest, WhatIsNoDatabaseIsRefused) {
  std::ofstream(folder_.path() / "store.db") << std::string(8192, 'x');
  const absl::Status status = open_error();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("store.db is damaged"));
}

TEST_F(SqliteStoreTest, DamagedPagesAreErrors) {
  {
    auto store = value(open_sqlite_store(folder_.path()));
    std::vector<NewTask> tasks;
    tasks.reserve(500);
    for (int i = 0; i < 500; ++i) tasks.push_back(cell(0, i));
    value(store->submit(new_job("r", tasks), 1));
  }
  const fs::path file = folder_.path() / "store.db";
  std::fstream stream(file, std::ios::in | std::ios::out | std::ios::binary);
  stream.seekp(4096);  // the first page holds the schema
  stream << std::string(fs::file_size(file) - 4096, '\x5A');
  stream.close();
  auto store = open_sqlite_store(folder_.path());
  const absl::Status status = store.ok() ? (*store)->submit(new_job("s", {cell(0, 0)}), 2).status() : store.status();
  EXPECT_EQ(status.code(), absl::StatusCode::kDataLoss) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr("store.db is damaged"));
}

TEST_F(SqliteStoreTest, FoldersThatCannotBeUsedAreErrors) {
  std::ofstream(folder_.path() / "file") << "x";
  const absl::Status no_folder = open_sqlite_store(folder_.path() / "file").status();
  EXPECT_EQ(no_folder.code(), absl::StatusCode::kPermissionDenied) << no_folder;
  EXPECT_THAT(std::string(no_folder.message()), HasSubstr("file: Not a directory"));
  fs::create_directory(folder_.path() / "store.db");
  const absl::Status no_file = open_error();
  EXPECT_EQ(no_file.code(), absl::StatusCode::kPermissionDenied) << no_file;
  EXPECT_THAT(std::string(no_file.message()), HasSubstr("cannot write"));
}

TEST_F(SqliteStoreTest, AFullDiskChangesNothingAndPasses) {
  auto store = value(open_sqlite_store(folder_.path()));
  const Job first = value(store->submit(new_job("r", {cell(0, 0)}), 1));
  ASSERT_EQ(sqlite3_exec(connection, "PRAGMA max_page_count = 40", nullptr, nullptr, nullptr), SQLITE_OK);
  std::vector<NewTask> tasks(200, cell(0, 0));
  for (NewTask& task : tasks) task.argument.assign(kMaxArgument, 'a');
  const absl::Status status = store->submit(new_job("s", tasks), 2).status();
  EXPECT_EQ(status.code(), absl::StatusCode::kResourceExhausted) << status;
  EXPECT_THAT(std::string(status.message()), HasSubstr(folder_.path().string()));
  EXPECT_THAT(std::string(status.message()), Not(HasSubstr("\n")));
  const absl::Status of_group = store->group([&] {
    (void)store->submit(new_job("s", tasks), 2);
    return absl::OkStatus();
  });
  EXPECT_EQ(of_group.code(), absl::StatusCode::kResourceExhausted) << of_group;
  EXPECT_EQ(value(store->jobs(0, 10)).size(), 1u);
  EXPECT_TRUE(value(store->lease({1, "w", "t", 100, 1}, 10))) << "small changes still fit";

  ASSERT_EQ(sqlite3_exec(connection, "PRAGMA max_page_count = 4000", nullptr, nullptr, nullptr), SQLITE_OK);
  EXPECT_EQ(value(store->submit(new_job("s", tasks), 3)).tasks, 200u);
}

/// Steps of SQLite's machine: the work of a call, in a unit that no clock disturbs.
int64_t steps_of(const std::function<void()>& call) {
  int64_t steps = 0;
  const auto count = [](void* counter) {
    ++*static_cast<int64_t*>(counter);
    return 0;
  };
  sqlite3_progress_handler(connection, 1, count, &steps);
  call();
  sqlite3_progress_handler(connection, 0, nullptr, nullptr);
  return steps;
}

TEST_F(SqliteStoreTest, ManyQueuedTasksMakeNoCallDearer) {
  const auto measure = [](Store& store, int n) {
    std::vector<NewTask> tasks;
    tasks.reserve(static_cast<size_t>(n));
    for (int i = 0; i < n; ++i) tasks.push_back(cell(static_cast<uint32_t>(i % 2), i));
    value(store.submit(new_job(absl::StrCat("r", n), tasks), 1));
    for (TaskId task = 1; task <= 9; task += 2) {
      EXPECT_TRUE(value(store.lease({task, "w", absl::StrCat("warm", task), 100, 1}, 10)));
    }
    std::vector<int64_t> steps;
    steps.push_back(steps_of([&] { EXPECT_EQ(value(store.view(20)).at(0).ready.size(), 20u); }));
    steps.push_back(steps_of([&] { EXPECT_TRUE(value(store.lease({11, "w", "t", 100, 1}, 10))); }));
    steps.push_back(
        steps_of([&] { EXPECT_EQ(value(store.complete("t", {digest(1)}, {}, 20)), Completion::kAccepted); }));
    steps.push_back(steps_of([&] { EXPECT_TRUE(value(store.fail("warm1", "broke", 30, 1))); }));
    steps.push_back(steps_of([&] { EXPECT_EQ(value(store.expire(200)).size(), 4u); }));
    steps.push_back(steps_of([&] { value(store.cancel(1, 40)); }));
    return steps;
  };
  const TemporaryFolder small_folder;
  auto small = value(open_sqlite_store(small_folder.path()));
  const std::vector<int64_t> few = measure(*small, 200);
  auto large = value(open_sqlite_store(folder_.path()));
  const std::vector<int64_t> many = measure(*large, 100'000);
  ASSERT_EQ(few.size(), many.size());
  for (size_t i = 0; i < few.size(); ++i) {
    EXPECT_GT(few[i], 10) << "call " << i << " was not counted";
    EXPECT_LE(many[i], few[i] + few[i] / 10) << "call " << i;
  }
}

}  // namespace
}  // namespace lightloom::test
