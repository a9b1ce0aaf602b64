// The tables of a store.
#pragma once

#include <cstdint>

#include "bake-server/store/database.h"
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

template <class Enum>
int64_t number(Enum value) {
  return static_cast<int64_t>(value);
}

/// Makes the tables in an empty database. FailedPrecondition for a newer schema or somebody else's database.
absl::Status prepare_schema(Database& database);
/// For who only reads: FailedPrecondition unless the tables are those of this release.
absl::Status check_schema(Database& database);

}  // namespace lightloom
