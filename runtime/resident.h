// What those who read an asset share in making its chunks resident.
#pragma once

#include <absl/functional/function_ref.h>

#include <span>
#include <vector>

#include "runtime/asset_index.h"
#include "runtime/asset_source.h"
#include "runtime/include/lightloom.h"

namespace lightloom {

/// UNKNOWN_CHUNK if the manifest does not name it.
absl::StatusOr<AssetIndex::Target> find_chunk(const AssetIndex& index, const Digest& digest);

SurfaceKeys keys_of_surface(const SurfaceChunk& chunk, std::pmr::memory_resource* memory);

/// The keys of the objects that a chunk names; `resident` gives those of an object, null if it is not resident: then
/// NOT_READY. Objects without a surface have none.
absl::StatusOr<std::vector<SurfaceKeys>> keys_of_objects(const AssetIndex& index, std::span<const uint32_t> objects,
                                                         absl::FunctionRef<SurfaceKeys(uint32_t)> resident);

/// A cell or relight chunk of the manifest, checked, its texels as surface elements. As AssetIndex::cell, relight,
/// elements and keys_of_objects fail.
absl::StatusOr<SourceCell> resolve_cell(const AssetIndex& index, uint32_t cell, std::span<const uint8_t> bytes,
                                        absl::FunctionRef<SurfaceKeys(uint32_t)> resident);
absl::StatusOr<std::vector<uint32_t>> resolve_relight(const AssetIndex& index, uint32_t probe,
                                                      std::span<const uint8_t> bytes,
                                                      absl::FunctionRef<SurfaceKeys(uint32_t)> resident);

/// InvalidArgument: a base comes first.
absl::Status late_base();

/// What the index alone says; the rest is 0.
lightloom_counts counts_of(const AssetIndex& index);

}  // namespace lightloom
