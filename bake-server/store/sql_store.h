// Store on a database that speaks SQL.
#pragma once

#include <functional>
#include <memory>
#include <vector>

#include "bake-server/store/database.h"
#include "bake-server/store/store.h"

namespace lightloom {

struct SqlStoreParts {
  std::shared_ptr<void> held;          ///< let go when the database is closed; may be null
  std::unique_ptr<Database> database;  ///< with its tables (schema.h)
  std::function<absl::StatusOr<std::unique_ptr<Database>>()>
      open_reader;  ///< another connection, which waits for no writer
  /// Whether these outputs still are, so that they can be used again; null: always.
  std::function<bool(const std::vector<Digest>& outputs)> there;
};

std::unique_ptr<Store> make_sql_store(SqlStoreParts parts);

}  // namespace lightloom
