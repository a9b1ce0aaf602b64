// The steps of a bake on a farm, each with its progress: what submit and fetch do alone and `bake --server` in a row.
#pragma once

#include <string>

#include "cli/earlier_bake.h"
#include "cli/farm_client.h"
#include "core/bake/bake.h"

namespace lightloom {

/// Before any work: there is such a level, and it is a .glb, which holds all of it.
absl::Status check_farm_level(const std::string& scene);

/// REQUIRES: the level was loaded, so that what is wrong with it was said here, not by a worker. `name` empty: the level's.
/// `earlier` may be null.
absl::StatusOr<RemoteJob> submit_level(FarmClient* farm, const std::string& scene, const BakeParams& params,
                                       const EarlierBake* earlier, const std::string& name, int32_t priority);

absl::StatusOr<Manifest> fetch_asset(FarmClient* farm, uint64_t job, const std::string& loom);

struct FarmBake {
  RemoteJob job;
  BakeReport report;  ///< of its times only seconds_total and seconds_write
};

/// Bakes a level on the farm at `server` into the folder `loom`. An interrupt cancels the job; errors after its submission
/// say where it stands.
absl::StatusOr<FarmBake> farm_bake(FarmClient* farm, const std::string& server, const std::string& scene,
                                   const BakeParams& params, const EarlierBake* earlier, const std::string& loom);

}  // namespace lightloom
