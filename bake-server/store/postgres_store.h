// The farm's state in a PostgreSQL database, which several servers may share.
#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "bake-server/store/database.h"
#include "bake-server/store/store.h"
#include "core/base/file.h"

namespace lightloom {

/// The database must be there; the first server makes the tables. FailedPrecondition for a newer schema or somebody else's
/// tables; else the errors of open_postgres(). `there`: as open_sqlite_store().
absl::StatusOr<std::unique_ptr<Store>> open_postgres_store(
    const std::string& url, Durability durability = Durability::kPowerLoss,
    std::function<bool(const std::vector<Digest>& outputs)> there = nullptr);

/// A connection to write by, with the tables.
absl::StatusOr<std::unique_ptr<Database>> make_postgres(const std::string& url,
                                                        Durability durability = Durability::kPowerLoss);

/// To read beside servers. FailedPrecondition if the tables are not those of this release.
absl::StatusOr<std::unique_ptr<Database>> open_postgres_reader(const std::string& url);

/// All that the database holds at one moment, put into one that is empty. Servers go on meanwhile.
absl::Status copy_postgres(const std::string& url, Database& to);

}  // namespace lightloom
