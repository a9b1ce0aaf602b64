// An asset read chunk by chunk through a caller's function, everything checked, texels resolved to surface
// elements.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "core/asset/chunk.h"
#include "core/asset/manifest.h"
#include "runtime/asset_index.h"

namespace lightloom {

/// Fills `out` (ref.size bytes) with the chunk. Its status is passed on.
using ReadChunk = std::function<absl::Status(const ChunkRef& ref, std::span<uint8_t> out)>;

/// A bake cell whose receivers are surface elements.
struct SourceCell {
  CellChunk chunk;
  std::vector<uint32_t> elements;       ///< per receiver
  std::vector<uint32_t> near_elements;  ///< of CellChunk::near_texels
  std::vector<uint32_t> probes;         ///< the cell's probe list: indices into Manifest::probes
};

/// Marks the cell's receivers in `received` (S). DataLoss if one is marked already: no two receivers may
/// share an E.
absl::Status mark_receivers(uint32_t index, const SourceCell& cell, std::vector<bool>* received);

/// Surface elements are numbered 0..S-1: objects in manifest order, the keys of each object's surface chunk
/// ascending.
class AssetSource {
 public:
  /// Reads the manifest and every surface chunk. DataLoss: corrupt; Unimplemented: newer, or beyond this
  /// reader's limits.
  static absl::StatusOr<AssetSource> open(std::span<const uint8_t> manifest, ReadChunk read);

  const Manifest& manifest() const { return manifest_; }
  const AssetIndex& index() const { return index_; }
  uint32_t surface_elements() const { return index_.surface_elements(); }

  /// Each cell and each probe's rays may be read any number of times, in any order.
  absl::StatusOr<SourceCell> cell(uint32_t index) const;
  /// relight_rays entries: a surface element, RelightChunk::kDead or kSky.
  absl::StatusOr<std::vector<uint32_t>> relight(uint32_t probe) const;

 private:
  AssetSource(Manifest manifest, AssetIndex index, ReadChunk read)
      : manifest_(std::move(manifest)), index_(std::move(index)), read_(std::move(read)) {}
  absl::StatusOr<std::vector<uint8_t>> chunk(const ChunkRef& ref) const;

  Manifest manifest_;
  AssetIndex index_;
  ReadChunk read_;
  std::vector<SurfaceKeys> keys_;  ///< per object
};

/// Why a chunk of that size is not even read.
absl::Status check_chunk_size(const ChunkRef& ref);

}  // namespace lightloom
