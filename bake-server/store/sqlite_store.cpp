#include "bake-server/store/sqlite_store.h"

#include <absl/strings/str_cat.h>

#include <system_error>
#include <utility>

#include "bake-server/store/folder_lock.h"
#include "bake-server/store/schema.h"
#include "bake-server/store/sql_store.h"
#include "bake-server/store/sqlite_database.h"

namespace lightloom {

namespace fs = std::filesystem;

absl::StatusOr<std::unique_ptr<Store>> open_sqlite_store(const fs::path& folder, Durability durability,
                                                         std::function<bool(const std::vector<Digest>&)> there) {
  auto lock = std::make_shared<FolderLock>();
  LL_RETURN_IF_ERROR(lock->take(folder));
  LL_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, SqliteDatabase::open(folder / "store.db", durability));
  LL_RETURN_IF_ERROR(prepare_schema(*database));
  return make_sql_store({.held = std::move(lock),
                         .database = std::move(database),
                         .open_reader = [folder] { return open_sqlite_reader(folder); },
                         .there = std::move(there)});
}

absl::StatusOr<std::unique_ptr<Database>> make_sqlite(const fs::path& file) {
  LL_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, SqliteDatabase::open(file, Durability::kProcess));
  LL_RETURN_IF_ERROR(prepare_schema(*database));
  return database;
}

absl::StatusOr<std::unique_ptr<Database>> open_sqlite_reader(const fs::path& folder) {
  const fs::path file = folder / "store.db";
  std::error_code error;
  if (!fs::is_regular_file(file, error)) {
    return absl::FailedPreconditionError(absl::StrCat(
        folder.string(), " is no state folder of lightloom-server (it has no store.db): give one that --state names"));
  }
  LL_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, SqliteDatabase::open(file, Durability::kProcess));
  LL_RETURN_IF_ERROR(check_schema(*database));
  return database;
}

absl::Status copy_sqlite(Database& database, const fs::path& to) {
  // A snapshot, without the pages that are free.
  return database.run("VACUUM INTO ?1", to.string()).status();
}

}  // namespace lightloom
