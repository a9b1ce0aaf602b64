// Carries all that a store remembers from one database to another: backups of PostgreSQL are SQLite files, and back.
#pragma once

#include "bake-server/store/database.h"

namespace lightloom {

/// REQUIRES: both have the tables of this release (schema.h); `from` does not change meanwhile. One transaction of `to`:
/// AlreadyExists if it has jobs. Errors: those of either.
absl::Status copy_tables(Database& from, Database& to);

}  // namespace lightloom
