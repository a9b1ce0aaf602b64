#include "bake-server/farm.h"

#include "bake-server/store/postgres_store.h"
#include "bake-server/store/sqlite_store.h"
#include "bake-server/upkeep/quota.h"

namespace lightloom {

absl::StatusOr<std::unique_ptr<Farm>> Farm::open(const std::filesystem::path& folder, const CoordinatorOptions& options,
                                                 Durability durability, const FarmLimits& limits,
                                                 const std::string& database) {
  auto farm = std::make_unique<Farm>();
  // First: a folder of another server must stay as it is.
  const auto there = [self = farm.get()](const std::vector<Digest>& outputs) {
    return self->blobs_->require(outputs).ok();
  };
  LL_ASSIGN_OR_RETURN(farm->store_, database.empty() ? open_sqlite_store(folder, durability, there)
                                                     : open_postgres_store(database, durability, there));
  farm->space_ = std::make_unique<FreeSpace>(folder, limits.min_free, limits.measure);
  LL_ASSIGN_OR_RETURN(farm->blobs_, BlobStore::open(folder / "blobs", durability,
                                                    [space = farm->space_.get()] { return space->check(); }));
  CoordinatorOptions bounded = options;
  if (limits.min_free > 0) {
    bounded.dispatch.paused = [space = farm->space_.get()] { return !space->check().ok(); };
  }
  if (limits.quota > 0) {
    bounded.check_submit = [quota = limits.quota, store = farm->store_.get(), blobs = farm->blobs_.get()](
                               const NewJob& job) { return check_quota(quota, job, store, *blobs); };
  }
  const auto clock = [store = farm->store_.get()] { return store->now_ms(); };
  farm->coordinator_ = std::make_unique<Coordinator>(farm->store_.get(), farm->blobs_.get(), clock, bounded);
  if (limits.upkeep) farm->upkeep_ = std::make_unique<Upkeep>(folder, farm->store_.get(), clock, *limits.upkeep);
  return farm;
}

}  // namespace lightloom
