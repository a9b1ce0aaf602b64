#include "runtime/asset_source.h"

#include <string>
#include <utility>

#include "runtime/resident.h"

namespace lightloom {
namespace {

/// No baker writes larger ones; a manifest that claims them must not make us allocate them.
constexpr uint64_t kMaxChunkBytes = 1ull << 30;

}  // namespace

absl::Status check_chunk_size(const ChunkRef& ref) {
  if (ref.size <= kMaxChunkBytes) return absl::OkStatus();
  return absl::DataLossError("chunk " + ref.digest.hex() + " is corrupt: its size is above 1 GiB; bake again");
}

absl::Status mark_receivers(uint32_t index, const SourceCell& cell, std::vector<bool>* received) {
  for (const uint32_t element : cell.elements) {
    if ((*received)[element]) {
      return absl::DataLossError("cell " + std::to_string(index) +
                                 " is corrupt: a receiver occurs twice; bake again or fetch it again");
    }
    (*received)[element] = true;
  }
  return absl::OkStatus();
}

absl::StatusOr<AssetSource> AssetSource::open(std::span<const uint8_t> bytes, ReadChunk read) {
  LL_ASSIGN_OR_RETURN(Manifest manifest, decode_manifest(bytes));
  LL_ASSIGN_OR_RETURN(AssetIndex index, AssetIndex::create(manifest, std::pmr::new_delete_resource()));
  AssetSource source(std::move(manifest), std::move(index), std::move(read));
  for (uint32_t o = 0; o < source.index_.objects().size(); ++o) {
    std::pmr::vector<uint32_t> keys;
    if (const ChunkRef& ref = source.index_.objects()[o].surface; ref.size != 0) {
      LL_ASSIGN_OR_RETURN(const auto surface_bytes, source.chunk(ref));
      LL_ASSIGN_OR_RETURN(const SurfaceChunk surface, source.index_.surface(o, surface_bytes));
      keys.assign(surface.keys.begin(), surface.keys.end());
    }
    source.keys_.push_back(std::make_shared<const std::pmr::vector<uint32_t>>(std::move(keys)));
  }
  return source;
}

absl::StatusOr<SourceCell> AssetSource::cell(uint32_t index) const {
  LL_ASSIGN_OR_RETURN(const auto bytes, chunk(index_.cells()[index].chunk));
  return resolve_cell(index_, index, bytes, [this](uint32_t o) { return keys_[o]; });
}

absl::StatusOr<std::vector<uint32_t>> AssetSource::relight(uint32_t probe) const {
  LL_ASSIGN_OR_RETURN(const auto bytes, chunk(index_.probes()[probe].relight));
  return resolve_relight(index_, probe, bytes, [this](uint32_t o) { return keys_[o]; });
}

absl::StatusOr<std::vector<uint8_t>> AssetSource::chunk(const ChunkRef& ref) const {
  LL_RETURN_IF_ERROR(check_chunk_size(ref));
  std::vector<uint8_t> bytes(ref.size);
  LL_RETURN_IF_ERROR(read_(ref, bytes));
  return bytes;
}

}  // namespace lightloom
