// The tables of sqlite_store.cpp.
#pragma once

#include <filesystem>

#include "bake-server/store/sqlite_database.h"
#include "core/base/status.h"

namespace lightloom {

// Stored: never renumber.
enum class StoredTask { kWaits = 0, kDone = 1, kFailed = 2 };
enum class AttemptState {
  kLive = 0,
  kCompleted = 1,
  kFailed = 2,
  kExpired = 3,
  kReleased = 4,
  kSuperseded = 5,  // its task was done by another, or failed for good
  kCancelled = 6,
  kMismatched = 7,  // it raised the alarm; once is enough
};

/// Makes the tables in an empty database. FailedPrecondition for a newer schema or somebody else's database.
absl::Status prepare_sqlite_schema(Database& database, const std::filesystem::path& file);
/// For who only reads: FailedPrecondition unless the tables are those of this release.
absl::Status check_sqlite_schema(Database& database, const std::filesystem::path& file);

}  // namespace lightloom
