#include "bake-server/store/copy_tables.h"

#include <absl/strings/str_cat.h>

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace lightloom {
namespace {

struct Table {
  const char* select;
  const char* insert;
  std::string_view columns;  // i: integer, t: text, b: bytes
};

// Parents first.
constexpr Table kTables[] = {
    {"SELECT id, client, request_id, content, name, created_ms, inputs, payload, work FROM jobs ORDER BY id",
     "INSERT INTO jobs (id, client, request_id, content, name, created_ms, inputs, payload, work)"
     " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
     "ittbtibbb"},
    {"SELECT job, state, priority, open_stage, finished_ms, tasks, ready, running, done, failed, reused, revision, "
     "error"
     " FROM progress ORDER BY job",
     "INSERT INTO progress (job, state, priority, open_stage, finished_ms, tasks, ready, running, done, failed, reused,"
     " revision, error) VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)",
     "iiiiiiiiiiiit"},
    {"SELECT id, job, stage, ord, state, live, failures, kind, error, outputs, argument, key, spawner"
     " FROM tasks ORDER BY id",
     "INSERT INTO tasks (id, job, stage, ord, state, live, failures, kind, error, outputs, argument, key, spawner)"
     " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9, ?10, ?11, ?12, ?13)",
     "iiiiiiittbbbi"},
    {"SELECT id, task, token, worker, state, leased_ms, expires_ms FROM attempts ORDER BY id",
     "INSERT INTO attempts (id, task, token, worker, state, leased_ms, expires_ms)"
     " VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7)",
     "iittiii"},
    {"SELECT id, job, at_ms, task, worker, what FROM events ORDER BY id",
     "INSERT INTO events (id, job, at_ms, task, worker, what) VALUES (?1, ?2, ?3, ?4, ?5, ?6)", "iiiitt"},
};

absl::Status copy_table(const Table& table, Database& from, Database& to) {
  Query rows = from.query(table.select);
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, rows.step());
    if (!row) return absl::OkStatus();
    std::vector<std::string> bytes(table.columns.size());
    std::vector<Value> values;
    for (size_t i = 0; i < table.columns.size(); ++i) {
      const int column = static_cast<int>(i);
      if (table.columns[i] == 'i') {
        values.emplace_back(rows.integer(column));
        continue;
      }
      bytes[i] = rows.bytes(column);
      if (table.columns[i] == 't') {
        values.emplace_back(bytes[i]);
      } else {
        values.emplace_back(Blob{bytes[i]});
      }
    }
    LL_RETURN_IF_ERROR(to.send_values(table.insert, values));
  }
}

}  // namespace

absl::Status copy_tables(Database& from, Database& to) {
  Transaction transaction(to);
  LL_RETURN_IF_ERROR(transaction.begin());
  {
    Query any = to.query("SELECT id FROM jobs LIMIT 1");
    LL_ASSIGN_OR_RETURN(const bool row, any.step());
    if (row) return absl::AlreadyExistsError(absl::StrCat(to.name(), " has jobs of its own: give an empty one"));
  }
  for (const Table& table : kTables) LL_RETURN_IF_ERROR(copy_table(table, from, to));
  LL_RETURN_IF_ERROR(to.number_on());
  return transaction.commit();
}

}  // namespace lightloom
