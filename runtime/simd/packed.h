// Cells and probes as the kernels read them: fp16 stays fp16, what a pass reads lies together.
#pragma once

#include "runtime/asset_source.h"
#include "runtime/simd/array.h"
#include "runtime/simd/kernels.h"

namespace lightloom::simd {

/// Offsets are into the arrays of the cell.
struct PackedCluster {
  size_t projection = 0, reconstruction = 0;
  uint32_t probes = 0, probe_count = 0;
  uint32_t correction = 0, rank = 0;
  uint32_t coefficients = 0;  ///< 4 floats each
  uint32_t receivers = 0, padded = 0;
  uint32_t first = 0;  ///< receiver, of elements and uniform
};

struct PackedCell {
  Array<PackedCluster> clusters;
  Array<uint16_t> projection, reconstruction;
  Array<float> correction;
  Array<uint32_t> probes;         ///< of the manifest
  Array<uint32_t> elements;       ///< each cluster's padded to kReceiverAlign, ascending
  Array<uint16_t> uniform;        ///< likewise
  Array<uint32_t> near_first;     ///< likewise, and one more: of near_elements and near_weights
  Array<uint32_t> near_elements;  ///< whose B counts, ascending for each receiver
  Array<float> near_weights;
  Array<uint64_t> near_tiles;  ///< bit t: one of them is in tile t
  Array<float> coefficients;
  uint32_t stride = 0;
  uint64_t projection_bytes = 0, reconstruction_bytes = 0;  ///< in the asset; near fields, too

  ClusterView view(const PackedCluster& c) const;
  uint64_t bytes() const;
};

struct PackedProbe {
  Array<uint32_t> elements;  ///< per ray; the dead one or the sky instead of RelightChunk::kDead, kSky
  Array<uint64_t> tiles;     ///< bit t: a ray hits an element of tile t
  bool sees_sky = false;

  uint64_t bytes() const { return elements.bytes() + tiles.bytes(); }
};

/// Tiles of `surface_elements`, the last one padded.
inline uint32_t tiles_of(uint32_t surface_elements) { return (surface_elements + kTile - 1) / kTile; }
/// Two elements behind the last tile: one is always black, one has the sky's radiance.
inline uint32_t dead_element(uint32_t surface_elements) { return tiles_of(surface_elements) * kTile; }
inline uint32_t sky_element(uint32_t surface_elements) { return dead_element(surface_elements) + 1; }
/// Words of a set of tiles.
inline uint32_t tile_words(uint32_t surface_elements) { return (tiles_of(surface_elements) + 63) / 64; }
/// Whether two sets of tiles have one in common.
inline bool intersect(const Array<uint64_t>& a, const Array<uint64_t>& b) {
  for (size_t i = 0; i < a.size(); ++i) {
    if ((a[i] & b[i]) != 0) return true;
  }
  return false;
}

/// REQUIRES: the cell and the rays are AssetSource's. `full_bands`: the cell has as many as λ.
PackedCell pack_cell(const SourceCell& cell, uint32_t surface_elements, bool full_bands,
                     std::pmr::memory_resource* memory);
PackedProbe pack_probe(std::span<const uint32_t> rays, uint32_t surface_elements, std::pmr::memory_resource* memory);

}  // namespace lightloom::simd
