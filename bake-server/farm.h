// What a server keeps in its state folder, and the coordinator that works on it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

#include "bake-server/coordinator/coordinator.h"
#include "bake-server/upkeep/free_space.h"
#include "bake-server/upkeep/upkeep.h"

namespace lightloom {

/// What keeps a state folder in bounds. As it is: nothing does.
struct FarmLimits {
  uint64_t min_free = 0;  ///< bytes; while the file system has less, uploads are refused and no tasks are given out
  uint64_t quota = 0;     ///< bytes that one client's jobs may keep (check_quota); 0: any
  std::optional<UpkeepOptions> upkeep;
  FreeSpace::Measure measure = free_bytes;
};

class Farm {
 public:
  /// FOLDER/blobs, and FOLDER/store.db and FOLDER/lock, unless `database` is a PostgreSQL address: then other servers may use
  /// both, too. Errors: another server has the folder, it or the database cannot be used, is damaged or of a newer release.
  static absl::StatusOr<std::unique_ptr<Farm>> open(const std::filesystem::path& folder,
                                                    const CoordinatorOptions& options = {},
                                                    Durability durability = Durability::kPowerLoss,
                                                    const FarmLimits& limits = {}, const std::string& database = "");

  Coordinator& coordinator() { return *coordinator_; }
  BlobStore& blobs() { return *blobs_; }

 private:
  std::unique_ptr<Store> store_;
  std::unique_ptr<FreeSpace> space_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<Coordinator> coordinator_;  // these two use all above
  std::unique_ptr<Upkeep> upkeep_;
};

}  // namespace lightloom
