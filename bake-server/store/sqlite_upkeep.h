// What keeps the database in bounds, and what others than the server read of it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "bake-server/store/sqlite_database.h"
#include "bake-server/store/store.h"
#include "core/base/status.h"

namespace lightloom {

/// The database of the state folder, to read: a server may work on it meanwhile, and neither waits for the other.
/// FailedPrecondition if the folder is no state folder, or one of another release.
absl::StatusOr<std::unique_ptr<Database>> open_sqlite_reader(const std::filesystem::path& folder);

// What Store says of them:
absl::StatusOr<Forgotten> forget_ended(Database& database, int64_t before_ms, uint32_t limit);
absl::Status visit_references(Database& database, const VisitDigest& visit);
absl::StatusOr<std::vector<Digest>> references_of(Database& database, const std::string& client);

/// The database as it is at one moment, in a file that is not there yet. Does not wait for the disk.
absl::Status copy_database(Database& database, const std::filesystem::path& to);

}  // namespace lightloom
