#include "bake-server/store/schema.h"

#include <absl/strings/str_cat.h>

#include <cstdint>

namespace lightloom {
namespace {

constexpr int64_t kSchemaVersion = 2;

// A job's row never changes (its payload may be long); what does is its progress.
// A stage opens by one number, progress.open_stage: tasks hold no "blocked" or "ready" that would have to be rewritten
// by the hundred thousand. Whether a task that waits (state 0) is blocked, ready or cancelled, the job's progress says.
constexpr char kSchema[] = R"(
CREATE TABLE jobs (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  client TEXT NOT NULL,
  request_id TEXT NOT NULL,
  content BLOB NOT NULL,  -- digest of the request
  name TEXT NOT NULL,
  created_ms INTEGER NOT NULL,
  inputs BLOB NOT NULL,   -- 32 bytes each
  payload BLOB NOT NULL,
  work BLOB NOT NULL DEFAULT x'',  -- digest of what its tasks' results depend on
  UNIQUE (client, request_id));

CREATE TABLE progress (
  job INTEGER PRIMARY KEY REFERENCES jobs (id) ON DELETE CASCADE,
  state INTEGER NOT NULL DEFAULT 0,  -- JobState
  priority INTEGER NOT NULL,
  open_stage INTEGER NOT NULL,       -- the lowest stage with tasks that are not done
  finished_ms INTEGER NOT NULL DEFAULT 0,
  tasks INTEGER NOT NULL,
  ready INTEGER NOT NULL,
  running INTEGER NOT NULL DEFAULT 0,
  done INTEGER NOT NULL DEFAULT 0,
  failed INTEGER NOT NULL DEFAULT 0,
  reused INTEGER NOT NULL DEFAULT 0,
  revision INTEGER NOT NULL DEFAULT 1,
  error TEXT NOT NULL DEFAULT '');
CREATE INDEX progress_running ON progress (job) WHERE state = 0;

CREATE TABLE tasks (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  job INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  stage INTEGER NOT NULL,
  ord INTEGER NOT NULL,
  state INTEGER NOT NULL DEFAULT 0,  -- 0 waits, 1 done, 2 failed for good
  live INTEGER NOT NULL DEFAULT 0,   -- live attempts
  failures INTEGER NOT NULL DEFAULT 0,
  kind TEXT NOT NULL,
  error TEXT NOT NULL DEFAULT '',
  outputs BLOB NOT NULL DEFAULT x'', -- 32 bytes each
  argument BLOB NOT NULL,
  key BLOB NOT NULL DEFAULT x'',      -- equal ones have equal outputs; empty: none is known to be equal
  spawner INTEGER NOT NULL DEFAULT 0); -- the task that asked for it; 0: the job's submitter
CREATE INDEX tasks_by_order ON tasks (job, stage, ord);
CREATE INDEX tasks_idle ON tasks (job, stage, ord) WHERE state = 0 AND live = 0;
CREATE INDEX tasks_live ON tasks (job, ord) WHERE live > 0;
CREATE INDEX tasks_failed ON tasks (job, ord) WHERE state = 2;
CREATE INDEX tasks_results ON tasks (key) WHERE state = 1;
CREATE INDEX tasks_spawned ON tasks (spawner) WHERE spawner != 0;

CREATE TABLE attempts (
  id INTEGER PRIMARY KEY,
  task INTEGER NOT NULL REFERENCES tasks (id) ON DELETE CASCADE,
  token TEXT NOT NULL UNIQUE,
  worker TEXT NOT NULL,
  state INTEGER NOT NULL DEFAULT 0,  -- AttemptState
  leased_ms INTEGER NOT NULL,
  expires_ms INTEGER NOT NULL);
CREATE INDEX attempts_by_task ON attempts (task);
CREATE INDEX attempts_live ON attempts (task) WHERE state = 0;
CREATE INDEX attempts_expiring ON attempts (expires_ms) WHERE state = 0;

CREATE TABLE events (
  id INTEGER PRIMARY KEY AUTOINCREMENT,
  job INTEGER NOT NULL REFERENCES jobs (id) ON DELETE CASCADE,
  at_ms INTEGER NOT NULL,
  task INTEGER NOT NULL,  -- 0: the job itself
  worker TEXT NOT NULL,
  what TEXT NOT NULL);
CREATE INDEX events_by_job ON events (job);

PRAGMA user_version = 2;
)";
static_assert(kSchemaVersion == 2, "the schema's last line says so, too");

// From version 1, which remembered no keys: what it has is never reused.
constexpr char kFrom1[] = R"(
ALTER TABLE jobs ADD COLUMN work BLOB NOT NULL DEFAULT x'';
ALTER TABLE progress ADD COLUMN reused INTEGER NOT NULL DEFAULT 0;
ALTER TABLE tasks ADD COLUMN key BLOB NOT NULL DEFAULT x'';
ALTER TABLE tasks ADD COLUMN spawner INTEGER NOT NULL DEFAULT 0;
CREATE INDEX tasks_results ON tasks (key) WHERE state = 1;
CREATE INDEX tasks_spawned ON tasks (spawner) WHERE spawner != 0;
PRAGMA user_version = 2;
)";

}  // namespace

absl::Status prepare_schema(Database& database) {
  Transaction transaction(database);
  LL_RETURN_IF_ERROR(transaction.begin());
  LL_ASSIGN_OR_RETURN(const int64_t version, database.schema_version());
  if (version == kSchemaVersion) return absl::OkStatus();
  if (version == 1) {
    LL_RETURN_IF_ERROR(database.script(kFrom1));
    return transaction.commit();
  }
  if (version != 0) {
    return absl::FailedPreconditionError(absl::StrCat(database.name(), " has schema version ", version,
                                                      ", this server knows up to ", kSchemaVersion,
                                                      ": run the newer release that wrote it, or give another one"));
  }
  LL_ASSIGN_OR_RETURN(const bool empty, database.is_empty());
  if (!empty) {
    return absl::FailedPreconditionError(
        absl::StrCat(database.name(), " is a database of something else: give another one"));
  }
  LL_RETURN_IF_ERROR(database.script(kSchema));
  return transaction.commit();
}

absl::Status check_schema(Database& database) {
  LL_ASSIGN_OR_RETURN(const int64_t version, database.schema_version());
  if (version == kSchemaVersion) return absl::OkStatus();
  return absl::FailedPreconditionError(absl::StrCat(database.name(), " has schema version ", version,
                                                    ", this program knows ", kSchemaVersion,
                                                    ": use the release of the server that works on it"));
}

}  // namespace lightloom
