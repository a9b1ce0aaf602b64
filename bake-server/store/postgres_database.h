// One PostgreSQL connection. Statements are prepared once and sent ahead of each other (libpq's pipeline mode): a round trip is
// paid only where a result is read.
#pragma once

#include <memory>
#include <string>

#include "bake-server/store/database.h"
#include "core/base/file.h"

namespace lightloom {

/// `url`: postgresql://… or libpq's key=value words. One writer at a time, whichever coordinator it is of: a transaction begins
/// with an advisory lock, so that what it reads holds until it ends, as in SQLite. kProcess: commits do not wait for the disk
/// (tests). A connection that was lost is made anew with the next transaction. Unavailable if there is none, PermissionDenied if
/// the user may not.
absl::StatusOr<std::unique_ptr<Database>> open_postgres(const std::string& url,
                                                        Durability durability = Durability::kPowerLoss);

}  // namespace lightloom
