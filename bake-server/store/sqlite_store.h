// The farm's state in one folder, by SQLite: what a server embeds if it is given no database.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

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

}  // namespace lightloom
