#include "bake-server/store/postgres_store.h"

#include <utility>

#include "bake-server/store/copy_tables.h"
#include "bake-server/store/postgres_database.h"
#include "bake-server/store/schema.h"
#include "bake-server/store/sql_store.h"

namespace lightloom {

absl::StatusOr<std::unique_ptr<Store>> open_postgres_store(const std::string& url, Durability durability,
                                                           std::function<bool(const std::vector<Digest>&)> there) {
  LL_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, make_postgres(url, durability));
  return make_sql_store({.held = nullptr,
                         .database = std::move(database),
                         .open_reader = [url] { return open_postgres_reader(url); },
                         .there = std::move(there)});
}

absl::StatusOr<std::unique_ptr<Database>> make_postgres(const std::string& url, Durability durability) {
  LL_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, open_postgres(url, durability));
  LL_RETURN_IF_ERROR(prepare_schema(*database));
  return database;
}

absl::StatusOr<std::unique_ptr<Database>> open_postgres_reader(const std::string& url) {
  LL_ASSIGN_OR_RETURN(std::unique_ptr<Database> database, open_postgres(url));
  LL_RETURN_IF_ERROR(check_schema(*database));
  return database;
}

absl::Status copy_postgres(const std::string& url, Database& to) {
  LL_ASSIGN_OR_RETURN(const std::unique_ptr<Database> from, open_postgres_reader(url));
  LL_RETURN_IF_ERROR(from->script("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"));
  LL_RETURN_IF_ERROR(copy_tables(*from, to));
  return from->script("COMMIT");
}

}  // namespace lightloom
