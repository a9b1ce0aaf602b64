// What keeps the database in bounds, and what others than the server read of it.
#pragma once

#include <string>
#include <vector>

#include "bake-server/store/database.h"
#include "bake-server/store/store.h"
#include "core/base/status.h"

namespace lightloom {

// What Store says of them:
absl::StatusOr<Forgotten> forget_ended(Database& database, int64_t before_ms, uint32_t limit);
absl::Status visit_references(Database& database, const VisitDigest& visit);
absl::StatusOr<std::vector<Digest>> references_of(Database& database, const std::string& client);

}  // namespace lightloom
