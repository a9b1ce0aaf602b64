// Chunks on their way in, the same for all backends: checked, decoded, their texels resolved to surface elements.
#include "runtime/backend.h"

#include <utility>

#include "runtime/resident.h"

namespace lightloom {

void Backend::use(std::shared_ptr<const AssetIndex> index) {
  keys_.assign(index == nullptr ? 0 : index->objects().size(), nullptr);
  index_ = std::move(index);
}

SurfaceKeys Backend::keys_of(uint32_t object) const {
  const std::lock_guard lock(keys_mutex_);
  return keys_[object];
}

absl::Status Backend::load_chunk(const Digest& digest, std::span<const uint8_t> bytes, const Detail& detail) {
  LL_ASSIGN_OR_RETURN(const AssetIndex::Target target, find_chunk(index(), digest));
  if (resident(target, detail)) return absl::OkStatus();
  const auto keys = [this](uint32_t object) { return keys_of(object); };
  switch (target.kind) {
    case AssetIndex::Kind::kSurface: {
      LL_ASSIGN_OR_RETURN(const SurfaceChunk chunk, index().surface(target.index, bytes));
      SurfaceKeys of_object = keys_of_surface(chunk, memory_);
      LL_RETURN_IF_ERROR(load_surface(target.index, chunk));
      const std::lock_guard lock(keys_mutex_);
      keys_[target.index] = std::move(of_object);
      return absl::OkStatus();
    }
    case AssetIndex::Kind::kRelight: {
      LL_ASSIGN_OR_RETURN(const auto rays, resolve_relight(index(), target.index, bytes, keys));
      return load_relight(target.index, rays, detail);
    }
    case AssetIndex::Kind::kCell:
      break;
  }
  LL_ASSIGN_OR_RETURN(SourceCell source, resolve_cell(index(), target.index, bytes, keys));
  limit_rank(&source.chunk, detail.max_rank);
  return load_cell(target.index, source, detail);
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
