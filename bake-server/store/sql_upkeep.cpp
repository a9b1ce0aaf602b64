#include "bake-server/store/sql_upkeep.h"

#include <algorithm>

#include "bake-server/store/packed_digests.h"

namespace lightloom {
namespace {

/// Of rows that hold packed digests in column 0.
absl::Status visit_rows(Query rows, const VisitDigest& visit) {
  for (;;) {
    LL_ASSIGN_OR_RETURN(const bool row, rows.step());
    if (!row) return absl::OkStatus();
    for (const Digest& digest : unpack(rows.bytes(0))) {
      if (!visit(digest)) return absl::OkStatus();
    }
  }
}

/// The oldest job that ended before; 0: none.
absl::StatusOr<JobId> ended_before(Database& database, int64_t before_ms) {
  Query query =
      database.query("SELECT job FROM progress WHERE state != 0 AND finished_ms < ?1 ORDER BY job LIMIT 1", before_ms);
  LL_ASSIGN_OR_RETURN(const bool found, query.step());
  return found ? query.integer(0) : 0;
}

}  // namespace

absl::StatusOr<Forgotten> forget_ended(Database& database, int64_t before_ms, uint32_t limit) {
  Forgotten out;
  Transaction transaction(database);
  LL_RETURN_IF_ERROR(transaction.begin());
  for (int64_t left = limit;;) {
    LL_ASSIGN_OR_RETURN(const JobId job, ended_before(database, before_ms));
    out.more = job != 0;
    if (job == 0 || left <= 0) break;
    LL_ASSIGN_OR_RETURN(const int64_t events,
                        database.run("DELETE FROM events WHERE id IN"
                                     " (SELECT id FROM events INDEXED BY events_by_job WHERE job = ?1 LIMIT ?2)",
                                     job, left));
    left -= events;
    // Lower stages first: a result that is there to be used again still has what followed from it.
    LL_ASSIGN_OR_RETURN(const int64_t tasks,
                        database.run("DELETE FROM tasks WHERE id IN (SELECT id FROM tasks INDEXED BY tasks_by_order"
                                     " WHERE job = ?1 ORDER BY stage, ord LIMIT ?2)",
                                     job, left));
    left -= tasks;
    if (left <= 0) continue;
    LL_RETURN_IF_ERROR(database.run("DELETE FROM jobs WHERE id = ?1", job).status());
    --left;
    ++out.jobs;
  }
  LL_RETURN_IF_ERROR(transaction.commit());
  return out;
}

absl::Status visit_references(Database& database, const VisitDigest& visit) {
  // One statement, one moment.
  return visit_rows(database.query("SELECT inputs FROM jobs UNION ALL SELECT outputs FROM tasks WHERE state = 1"),
                    visit);
}

absl::StatusOr<std::vector<Digest>> references_of(Database& database, const std::string& client) {
  std::vector<Digest> digests;
  LL_RETURN_IF_ERROR(visit_rows(
      database.query(
          "SELECT inputs FROM jobs WHERE client = ?1 UNION ALL SELECT t.outputs FROM jobs j"
          " CROSS JOIN tasks t INDEXED BY tasks_by_order ON t.job = j.id WHERE j.client = ?1 AND t.state = 1",
          client),
      [&](const Digest& digest) {
        digests.push_back(digest);
        return true;
      }));
  std::sort(digests.begin(), digests.end());
  digests.erase(std::unique(digests.begin(), digests.end()), digests.end());
  return digests;
}

}  // namespace lightloom
