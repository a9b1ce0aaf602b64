// What the rest of a bake needs of a finished cell besides its chunk, and a later bake to use it again. The cell's task
// stores it, assembly reads it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/asset/chunk.h"
#include "core/asset/manifest.h"
#include "core/probes/probe_name.h"
#include "core/trace/trace.h"

namespace lightloom {

/// The texels of one object that a cell's near fields name.
struct NearSurface {
  ChunkObject object;
  std::vector<uint32_t> keys;  ///< ascending
  bool operator==(const NearSurface&) const = default;
};

/// Same for every run of the task: no times, and no counts that depend on what the worker remembers.
struct CellRecord {
  ChunkRef chunk;
  Aabb bounds;  ///< of its receivers
  uint64_t gather_rays = 0;
  uint64_t unseen = 0;                ///< gather rays whose hit no reachable probe sees
  double error = 0;                   ///< CompressedCell::error
  uint64_t coefficients = 0;          ///< Σ rank · receivers over the clusters
  uint64_t bytes_projection = 0;      ///< of the chunk
  uint64_t bytes_reconstruction = 0;  ///< of the chunk
  Digest key;                         ///< cell_key()
  Trace trace;
  float stale = 0;                     ///< see Reuse: 0 as it is baked
  std::vector<ProbeName> probes;       ///< that it reads, ascending
  std::vector<NearSurface> near;       ///< that its near fields name, by object id
  std::vector<ClusterEntry> clusters;  ///< in the chunk's order
  uint64_t receivers() const;          ///< of all clusters
};

std::vector<uint8_t> encode_cell_record(const CellRecord& record);
/// Trusts nothing: every count is checked against the bytes that are there, numbers are finite, probes ascend, sums
/// match the clusters. DataLoss says which of these is not so. Whether the probes exist, the plan's owner must check.
absl::StatusOr<CellRecord> decode_cell_record(std::span<const uint8_t> bytes);

}  // namespace lightloom
