// The three kinds of chunk: immutable, content-addressed, little-endian, every array 16-byte aligned so that a reader
// uploads it as it is. Bytes: docs/asset-format.md.
//
// A texel of an object's lightmap is named by its key: side·w·h + y·w + x, side 0 the front and 1 the back.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/half.h"
#include "core/base/hash.h"
#include "core/base/status.h"
#include "core/base/vec.h"

namespace lightloom {

/// Texels along a side of an object's lightmap, at most.
inline constexpr uint32_t kMaxObjectSide = 16384;

/// An object as a chunk knows it: by identity and lightmap size.
struct ChunkObject {
  Digest id;
  uint32_t width = 0, height = 0;
  bool operator==(const ChunkObject&) const = default;
};

/// A texel of the chunk's object number `slot`.
struct TexelRef {
  uint32_t slot = 0;
  uint32_t key = 0;
  bool operator==(const TexelRef&) const = default;
};

/// Receivers and compressed transport of one bake cell (SL17 Eq. 11).
///
/// For receiver r of a cluster with probe radiance λ (per colour):
///   c_0 = Σ_i √(4π)·λ_i0 ÷ (4π·P)                       mean radiance of the cluster's P probes; 0 if P = 0
///   c_k = Σ_ij projection[k][i][j]·λ_ij − correction[k]·c_0    k = 1..K
///   E_r = π·uniform[r]/65535·c_0 + Σ_k reconstruction[k][r]·c_k + Σ_i π·near_weights[i]/65535·B(near_texels[i])
/// so that the uniform field 1, as relight rays project it (sh_uniform), gives π·(uniform[r] + Σ_i near_weights[i])/65535,
/// whatever was truncated or rounded. i: the entries of receiver r, which follow those of the receivers before. B: radiance
/// that leaves a texel. They are the surfaces too near to the receiver for probes to resolve (ADR 0008).
struct CellChunk {
  struct Cluster {
    uint32_t first_receiver = 0, receivers = 0;
    std::vector<uint32_t> probes;   ///< P indices into the cell's probe list
    std::vector<float> correction;  ///< K: projection[k]·u, u = sh_uniform of every probe
    std::vector<Half> projection;  ///< K × P × sh_stride, rows Σ_c·V_cᵀ, padding 0; singular values descend (those
                                   ///< of averaged rows, if V is theirs)
    std::vector<Half> reconstruction;  ///< K × receivers rounded up to 8, columns of U_c, padding 0
    Aabb bounds;
    float error = 0;

    uint32_t rank() const { return static_cast<uint32_t>(correction.size()); }
  };

  uint32_t order = 0;
  uint32_t probe_count = 0;  ///< length of the cell's probe list in the manifest
  std::vector<ChunkObject> objects;
  std::vector<TexelRef> receivers;     ///< in cluster order
  std::vector<uint16_t> uniform;       ///< per receiver: irradiance under the uniform field 1 by probes, unorm16 of π
  std::vector<Cluster> clusters;       ///< cover the receivers in order, none empty
  std::vector<uint16_t> near_counts;   ///< per receiver: its near texels
  std::vector<uint32_t> near_texels;   ///< named as RelightChunk::rays are
  std::vector<uint16_t> near_weights;  ///< their share of the irradiance, unorm16 of π
};
inline constexpr uint64_t kNearTexelBytes = sizeof(uint32_t) + sizeof(uint16_t);  ///< that each takes

/// What one probe sees along sphere_direction(i, n), i = 0..n-1.
struct RelightChunk {
  /// Instead of a texel: nothing that shines (back faces, objects without lightmap), or the sky.
  static constexpr uint32_t kDead = 0xffffffffu;
  static constexpr uint32_t kSky = 0xfffffffeu;

  Vec3 position;
  std::vector<ChunkObject> objects;
  /// Per ray: base(object) + texel key, where base is the running sum of 2·w·h over `objects`; or kDead, kSky.
  std::vector<uint32_t> rays;
};

/// Octahedral unit vector, two snorm16 (Cigolle et al., JCGT 3(2), 2014): how surface chunks store normals.
uint32_t encode_normal(Vec3 n);

/// The valid texels of one object, sorted by key.
struct SurfaceChunk {
  ChunkObject object;
  std::vector<uint32_t> keys;
  std::vector<Vec3> positions;  ///< world space, on the surface
  std::vector<Vec3> normals;    ///< unit, of the texel's side; stored as two snorm16 (octahedral)
  std::vector<float> areas;     ///< m² of surface that the texel covers
};

std::vector<uint8_t> encode_cell(const CellChunk& chunk);
std::vector<uint8_t> encode_relight(const RelightChunk& chunk);
std::vector<uint8_t> encode_surface(const SurfaceChunk& chunk);

/// Decoders trust nothing: every count, offset, index and float is checked before use.
absl::StatusOr<CellChunk> decode_cell(std::span<const uint8_t> bytes);
absl::StatusOr<RelightChunk> decode_relight(std::span<const uint8_t> bytes);
absl::StatusOr<SurfaceChunk> decode_surface(std::span<const uint8_t> bytes);

}  // namespace lightloom
