#include <cstdio>

#include "bake-server/commands/commands.h"
#include "bake-server/store/postgres_store.h"
#include "bake-server/store/sql_upkeep.h"
#include "bake-server/store/sqlite_store.h"

namespace lightloom {

absl::Status gc(const std::string& state, const std::string& database, int64_t grace_seconds, bool dry_run,
                const CancelFlag& cancel) {
  LL_ASSIGN_OR_RETURN(const auto reader, database.empty() ? open_sqlite_reader(state) : open_postgres_reader(database));
  const References references = [&](const VisitDigest& visit) { return visit_references(*reader, visit); };
  LL_ASSIGN_OR_RETURN(const Garbage garbage, collect_garbage(state, references, {grace_seconds, dry_run, &cancel}));
  std::printf("%s\n", garbage_text(garbage, dry_run).c_str());
  return absl::OkStatus();
}

}  // namespace lightloom
