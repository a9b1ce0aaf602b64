// The farm's state in one folder, by SQLite: what a server embeds if it is given no database.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "bake-server/store/database.h"
#include "bake-server/store/store.h"
#include "core/base/file.h"
#include "core/base/status.h"

namespace lightloom {

/// Opens FOLDER/store.db, or begins it: the folder and those above it are made. FOLDER/lock is held while the store
/// lives, so that a second server refuses to start (FailedPrecondition). FailedPrecondition, too, for a newer schema or
/// somebody else's database, DataLoss for a damaged one. `there`: whether these outputs still are, so that they can be
/// used again; null: always.
absl::StatusOr<std::unique_ptr<Store>> open_sqlite_store(
    const std::filesystem::path& folder, Durability durability = Durability::kPowerLoss,
    std::function<bool(const std::vector<Digest>& outputs)> there = nullptr);

/// A new database with its tables, which does not wait for the disk.
absl::StatusOr<std::unique_ptr<Database>> make_sqlite(const std::filesystem::path& file);

/// The database of the state folder, to read: a server may work on it meanwhile, and neither waits for the other.
/// FailedPrecondition if the folder is no state folder, or one of another release.
absl::StatusOr<std::unique_ptr<Database>> open_sqlite_reader(const std::filesystem::path& folder);

/// The database as it is at one moment, in a file that is not there yet. Does not wait for the disk.
absl::Status copy_sqlite(Database& database, const std::filesystem::path& to);

}  // namespace lightloom
