// What a server keeps in its state folder, and the coordinator that works on it.
#pragma once

#include <filesystem>
#include <memory>

#include "bake-server/coordinator/coordinator.h"

namespace lightloom {

class Farm {
 public:
  /// FOLDER/store.db, FOLDER/blobs, FOLDER/lock. Errors: another server has the folder, it cannot be used, its database is
  /// damaged or of a newer release.
  static absl::StatusOr<std::unique_ptr<Farm>> open(const std::filesystem::path& folder,
                                                    const CoordinatorOptions& options = {},
                                                    Durability durability = Durability::kPowerLoss);

  Coordinator& coordinator() { return *coordinator_; }
  BlobStore& blobs() { return *blobs_; }

 private:
  std::unique_ptr<Store> store_;
  std::unique_ptr<BlobStore> blobs_;
  std::unique_ptr<Coordinator> coordinator_;  // last: it uses both
};

}  // namespace lightloom
