// Chunks on their way in, the same for all backends: checked, decoded, their texels resolved to surface elements.
#include "runtime/backend.h"

#include <utility>

#include "runtime/resident.h"

namespace lightloom {

void Backend::forget() {
  keys_.clear();
  index_ = nullptr;
}

absl::Status Backend::load_manifest(std::span<const uint8_t> bytes) {
  // The old asset goes first: both may not fit.
  unload();
  return reload_manifest(bytes);
}

absl::Status Backend::reload_manifest(std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const Manifest manifest, decode_manifest(bytes));
  LL_ASSIGN_OR_RETURN(const std::shared_ptr<const AssetIndex> index, AssetIndex::create_shared(manifest, memory_));
  const std::vector<AssetIndex::Kept> kept = loaded() ? index->kept_from(*index_) : std::vector<AssetIndex::Kept>();
  std::vector<SurfaceKeys> keys(index->objects().size());
  absl::Status started;
  try {
    started = start(index, kept);
  } catch (...) {
    unload();
    throw;
  }
  if (!started.ok()) {
    unload();
    return started;
  }
  keys_.swap(keys);
  index_ = index;
  return absl::OkStatus();
}

SurfaceKeys Backend::keys_of(uint32_t object) const {
  const std::lock_guard lock(keys_mutex_);
  return keys_[object];
}

absl::Status Backend::load_chunk(const Digest& digest, std::span<const uint8_t> bytes, const Detail& detail) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(index(), digest));
  if (resident(target, detail)) return absl::OkStatus();
  LL_ASSIGN_OR_RETURN(DecodedChunk chunk, decode(digest, bytes));
  return load(std::move(chunk), detail);
}

absl::StatusOr<DecodedChunk> Backend::decode(const Digest& digest, std::span<const uint8_t> bytes) const {
  DecodedChunk chunk;
  LL_ASSIGN_OR_RETURN(chunk.target, find_chunk(index(), digest));
  const uint32_t i = chunk.target.index;
  const auto keys = [this](uint32_t object) { return keys_of(object); };
  switch (chunk.target.kind) {
    case AssetIndex::Kind::kSurface: {
      LL_ASSIGN_OR_RETURN(chunk.surface, index().surface(i, bytes));
      break;
    }
    case AssetIndex::Kind::kRelight: {
      LL_ASSIGN_OR_RETURN(chunk.rays, resolve_relight(index(), i, bytes, keys));
      break;
    }
    case AssetIndex::Kind::kCell: {
      LL_ASSIGN_OR_RETURN(chunk.cell, resolve_cell(index(), i, bytes, keys));
      break;
    }
  }
  return chunk;
}

absl::Status Backend::load(DecodedChunk chunk, const Detail& detail) {
  switch (chunk.target.kind) {
    case AssetIndex::Kind::kSurface: {
      SurfaceKeys keys = keys_of_surface(chunk.surface, memory_);
      LL_RETURN_IF_ERROR(load_surface(chunk.target.index, chunk.surface));
      const std::lock_guard lock(keys_mutex_);
      keys_[chunk.target.index] = std::move(keys);
      return absl::OkStatus();
    }
    case AssetIndex::Kind::kRelight:
      return load_relight(chunk.target.index, chunk.rays, detail);
    case AssetIndex::Kind::kCell:
      break;
  }
  limit(&chunk.cell, detail);
  return load_cell(chunk.target.index, chunk.cell, detail);
}

absl::Status Backend::unload_chunk(const Digest& digest) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(index(), digest));
  if (target.kind == AssetIndex::Kind::kSurface) {
    const std::lock_guard lock(keys_mutex_);
    keys_[target.index] = nullptr;
  }
  unload_target(target);
  return absl::OkStatus();
}

absl::Status Backend::drop_detail(const Digest& digest) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(index(), digest));
  if (target.kind != AssetIndex::Kind::kSurface) drop_target_detail(target);
  return absl::OkStatus();
}

}  // namespace lightloom
