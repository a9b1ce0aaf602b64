// What the backends share in making chunks resident.
#pragma once

#include <absl/functional/function_ref.h>

#include <span>
#include <vector>

#include "runtime/asset_index.h"

namespace lightloom {

/// UNKNOWN_CHUNK if the manifest does not name it.
absl::StatusOr<AssetIndex::Target> find_chunk(const AssetIndex& index, const Digest& digest);

SurfaceKeys keys_of_surface(const SurfaceChunk& chunk, std::pmr::memory_resource* memory);

/// The keys of the objects that a chunk names; `resident` gives those of an object, null if it is not resident: then
/// NOT_READY. Objects without a surface have none.
absl::StatusOr<std::vector<SurfaceKeys>> keys_of_objects(const AssetIndex& index, std::span<const uint32_t> objects,
                                                         absl::FunctionRef<SurfaceKeys(uint32_t)> resident);

}  // namespace lightloom
