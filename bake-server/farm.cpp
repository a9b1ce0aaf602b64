#include "bake-server/farm.h"

#include "bake-server/store/sqlite_store.h"

namespace lightloom {

absl::StatusOr<std::unique_ptr<Farm>> Farm::open(const std::filesystem::path& folder, const CoordinatorOptions& options,
                                                 Durability durability) {
  auto farm = std::make_unique<Farm>();
  LL_ASSIGN_OR_RETURN(farm->store_, open_sqlite_store(folder, durability));
  LL_ASSIGN_OR_RETURN(farm->blobs_, BlobStore::open(folder / "blobs", durability));
  farm->coordinator_ =
      std::make_unique<Coordinator>(farm->store_.get(), farm->blobs_.get(), steady_unix_clock(), options);
  return farm;
}

}  // namespace lightloom
