// The manifest of a .loom asset: what was baked, with which parameters, and which chunk holds what.
// Bytes: docs/asset-format.md.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/hash.h"
#include "core/base/status.h"
#include "core/base/vec.h"

namespace lightloom {

enum class BakeMethod : uint32_t {
  kDefault,
  kSl17,  ///< Silvennoinen & Lehtinen 2017 as published: the baseline
};

/// Everything that the baked numbers depend on besides the scene. Recorded in the asset; a rebake uses the same.
struct BakeParams {
  static constexpr float kFollows = -1;  ///< near_field: so many spacings as kNearField says
  BakeMethod method = BakeMethod::kDefault;
  int32_t order = 7;              ///< SH order n of the probes
  float spacing = 0;              ///< ρ, side of a probe cell, metres; 0 in a request: chosen from the scene
  float near_field = kFollows;    ///< metres: texels nearer than that are read, not probes; kFollows in a request
  int32_t probes = 0;             ///< SL17: how many; 0: from the spacing
  int32_t links = 6;              ///< k, probes per receiver; SL17: N_overlap, on average
  int32_t rays = 256;             ///< gather rays per receiver
  int32_t relight_rays = 4096;    ///< per probe
  int32_t max_rank = 32;          ///< coefficients per cluster, without the uniform one
  float threshold = 0.02f;        ///< relative Frobenius error at which a cluster's rank ends
  int32_t cell_receivers = 1024;  ///< a bake cell holds fewer receivers than this
  float texels_per_metre = 0;     ///< lightmap density; 0 in a request: chosen from the scene
  int32_t lightmap_size = 0;      ///< side of the scene atlas; 0: from texels_per_metre
  float average = 0;              ///< σ, texels, over which rows are averaged to choose columns by; 0: not (ADR 0009)
  uint64_t seed = 0;

  bool operator==(const BakeParams&) const = default;
};
/// As SL17 Sec. 4.1 and 5 have it.
inline BakeParams sl17_params() {
  BakeParams p;
  p.method = BakeMethod::kSl17;
  p.near_field = 0;
  p.links = 10;
  p.threshold = 0.005f;
  p.relight_rays = 8000;
  return p;
}

/// Names a chunk. Size 0: absent (the object has no surface elements).
struct ChunkRef {
  Digest digest;
  uint64_t size = 0;
  bool operator==(const ChunkRef&) const = default;
};

struct ObjectEntry {
  Digest id;  ///< Object::id
  std::string name;
  int32_t width = 0, height = 0;  ///< of the local lightmap, texels
  int32_t x = 0, y = 0;           ///< of local texel (0,0) in the lightmap image
  ChunkRef surface;
  bool operator==(const ObjectEntry&) const = default;
};

struct ProbeEntry {
  Vec3 position;
  GridCell cell{};    ///< world cell of side `spacing`
  uint32_t slot = 0;  ///< numbers the probes of a cell
  ChunkRef relight;
  bool operator==(const ProbeEntry&) const = default;
};

/// Of a cell of the octree that bake cells are cut from, metres. A multiple of the probes' spacing: a level that is scaled
/// with its parameters has the same cells.
inline double cell_side(float spacing, int32_t level) { return std::ldexp(static_cast<double>(spacing), level); }

struct CellEntry {
  int32_t level = 0;  ///< the octree cell covers [i, i+1)·cell_side() on each axis
  GridCell cell{};
  Aabb bounds;  ///< of its receivers
  uint32_t receivers = 0;
  uint32_t first_cluster = 0, clusters = 0;  ///< range of Manifest::clusters
  uint32_t first_probe = 0, probes = 0;      ///< range of Manifest::cell_probes
  ChunkRef chunk;
  float error = 0;   ///< ‖S − S̃‖_F ÷ ‖S‖_F, S of receivers as average.h has them
  float unseen = 0;  ///< share of gather rays whose hit no linked probe sees
  float stale = 0;   ///< estimated share of its light that edits since it was baked may have changed; 0: none
};

struct ClusterEntry {
  Aabb bounds;
  uint32_t receivers = 0;
  uint32_t rank = 0;  ///< without the uniform column
  uint32_t probes = 0;
  float error = 0;  ///< as CellEntry::error
};

struct Manifest {
  std::string method_version;
  Digest scene_hash;              ///< of all that the transport depends on: see scene_hash()
  BakeParams params;              ///< with nothing left to choose
  uint32_t layout_mode = 0;       ///< LayoutMode
  int32_t width = 0, height = 0;  ///< of the lightmap image
  Aabb bounds;                    ///< of the static geometry
  std::vector<ObjectEntry> objects;
  std::vector<ProbeEntry> probes;
  std::vector<CellEntry> cells;
  std::vector<ClusterEntry> clusters;
  std::vector<uint32_t> cell_probes;  ///< indices into `probes`; cell chunks say "my i-th probe"
};

/// All chunks that it names, in no particular order; some may be named more than once.
std::vector<ChunkRef> chunks_of(const Manifest& manifest);

std::vector<uint8_t> encode_manifest(const Manifest& manifest);
/// Checks magic, version, CRC, every count against the bytes that are there, every index, and that numbers are finite.
absl::StatusOr<Manifest> decode_manifest(std::span<const uint8_t> bytes);

}  // namespace lightloom
