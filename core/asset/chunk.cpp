#include "core/asset/chunk.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>

#include "core/asset/texel_codes.h"
#include "core/base/bytes.h"
#include "core/base/check.h"
#include "core/base/octahedral.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

constexpr uint32_t kCellVersion = 2, kRelightVersion = 1, kSurfaceVersion = 1;
constexpr uint32_t kCellMagic = 0x43434c4cu;     // "LLCC"
constexpr uint32_t kRelightMagic = 0x52434c4cu;  // "LLCR"
constexpr uint32_t kSurfaceMagic = 0x53434c4cu;  // "LLCS"

absl::Status corrupt(absl::string_view what, absl::string_view why) {
  return absl::DataLossError(absl::StrCat(what, " chunk is corrupt: ", why, "; bake again or fetch it again"));
}

/// Fixed-size records, as they lie in the file.
struct CellHeader {
  uint32_t magic, version, order, probe_count;
  uint32_t objects, receivers, clusters, cluster_probes;
  uint64_t projection_halfs, reconstruction_halfs;
  uint32_t columns, near_texels;
};
struct ClusterRecord {
  uint32_t first_receiver, receivers, probes, rank;
  Vec3 lo, hi;
  float error;
  uint32_t reserved;
};
struct RelightHeader {
  uint32_t magic, version, objects, rays;
  Vec3 position;
  uint32_t reserved;
};
struct SurfaceHeader {
  uint32_t magic, version, texels, reserved;
  ChunkObject object;
};
static_assert(sizeof(CellHeader) == 56 && sizeof(ClusterRecord) == 48 && sizeof(RelightHeader) == 32 &&
              sizeof(SurfaceHeader) == 56 && sizeof(ChunkObject) == 40);

bool valid_object(const ChunkObject& o) {
  return o.width >= 1 && o.height >= 1 && o.width <= kMaxObjectSide && o.height <= kMaxObjectSide;
}
uint64_t texel_keys(const ChunkObject& o) { return 2ull * o.width * o.height; }
uint64_t rounded_up_to_8(uint64_t n) { return (n + 7) / 8 * 8; }
bool finite_half(Half h) { return (h & 0x7c00u) != 0x7c00u; }

Vec3 decode_normal(uint32_t bits) {
  const auto snorm = [](uint32_t b) {
    return std::max(static_cast<float>(static_cast<int16_t>(b & 0xffffu)) / 32767.0f, -1.0f);
  };
  return normalize(from_octahedral({snorm(bits), snorm(bits >> 16)}));
}

/// How many texels have codes.
absl::StatusOr<uint64_t> check_objects(absl::string_view what, const std::vector<ChunkObject>& objects) {
  if (!std::all_of(objects.begin(), objects.end(), valid_object)) {
    return corrupt(what, "an object's lightmap size is out of range");
  }
  const uint64_t codes = TexelCodes(objects).count();
  if (codes > RelightChunk::kSky) return corrupt(what, "its objects have too many texels");
  return codes;
}

}  // namespace

uint32_t encode_normal(Vec3 n) {
  const Vec2 p = octahedral(n);
  const auto snorm = [](float c) {
    return static_cast<uint16_t>(static_cast<int16_t>(std::floor(std::clamp(c, -1.0f, 1.0f) * 32767.0f + 0.5f)));
  };
  return static_cast<uint32_t>(snorm(p.x)) | static_cast<uint32_t>(snorm(p.y)) << 16;
}

std::vector<uint8_t> encode_cell(const CellChunk& c) {
  CellHeader header{};
  header.magic = kCellMagic;
  header.version = kCellVersion;
  header.order = c.order;
  header.probe_count = c.probe_count;
  header.objects = static_cast<uint32_t>(c.objects.size());
  header.receivers = static_cast<uint32_t>(c.receivers.size());
  header.clusters = static_cast<uint32_t>(c.clusters.size());

  std::vector<ClusterRecord> records;
  std::vector<uint32_t> probes;
  std::vector<float> correction;
  std::vector<Half> projection, reconstruction;
  const uint64_t stride = static_cast<uint64_t>(sh_stride(static_cast<int>(c.order)));
  LL_CHECK(c.uniform.size() == c.receivers.size() && c.near_counts.size() == c.receivers.size());
  LL_CHECK(c.near_texels.size() == c.near_weights.size());
  for (const CellChunk::Cluster& k : c.clusters) {
    LL_CHECK(k.projection.size() == k.rank() * k.probes.size() * stride);
    LL_CHECK(k.reconstruction.size() == k.rank() * rounded_up_to_8(k.receivers));
    records.push_back({k.first_receiver, k.receivers, static_cast<uint32_t>(k.probes.size()), k.rank(), k.bounds.lo,
                       k.bounds.hi, k.error, 0});
    probes.insert(probes.end(), k.probes.begin(), k.probes.end());
    correction.insert(correction.end(), k.correction.begin(), k.correction.end());
    projection.insert(projection.end(), k.projection.begin(), k.projection.end());
    reconstruction.insert(reconstruction.end(), k.reconstruction.begin(), k.reconstruction.end());
  }
  header.cluster_probes = static_cast<uint32_t>(probes.size());
  header.columns = static_cast<uint32_t>(correction.size());
  header.near_texels = static_cast<uint32_t>(c.near_texels.size());
  header.projection_halfs = projection.size();
  header.reconstruction_halfs = reconstruction.size();

  ByteWriter w;
  w.value(header);
  w.array(c.objects);
  w.array(c.receivers);
  w.array(c.uniform);
  w.array(records);
  w.array(probes);
  w.array(correction);
  w.array(projection);
  w.array(reconstruction);
  w.array(c.near_counts);
  w.array(c.near_texels);
  w.array(c.near_weights);
  return std::move(w).take();
}

absl::StatusOr<CellChunk> decode_cell(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<CellHeader>();
  if (header.magic != kCellMagic) return corrupt("cell", "it does not start with LLCC");
  if (header.version != kCellVersion) return corrupt("cell", absl::StrCat("version ", header.version, " is unknown"));
  if (header.order > kMaxShOrder) return corrupt("cell", absl::StrCat("its SH order is above ", kMaxShOrder));

  CellChunk c;
  c.order = header.order;
  c.probe_count = header.probe_count;
  c.objects = r.array<ChunkObject>(header.objects);
  c.receivers = r.array<TexelRef>(header.receivers);
  c.uniform = r.array<uint16_t>(header.receivers);
  const auto records = r.array<ClusterRecord>(header.clusters);
  const auto probes = r.array<uint32_t>(header.cluster_probes);
  const auto correction = r.array<float>(header.columns);
  const auto projection = r.array<Half>(header.projection_halfs);
  const auto reconstruction = r.array<Half>(header.reconstruction_halfs);
  c.near_counts = r.array<uint16_t>(header.receivers);
  c.near_texels = r.array<uint32_t>(header.near_texels);
  c.near_weights = r.array<uint16_t>(header.near_texels);
  if (!r.at_end()) return corrupt("cell", "its length does not match its counts");

  LL_ASSIGN_OR_RETURN(const uint64_t codes, check_objects("cell", c.objects));
  for (const TexelRef& t : c.receivers) {
    if (t.slot >= c.objects.size() || t.key >= texel_keys(c.objects[t.slot])) {
      return corrupt("cell", "a receiver lies outside its object's lightmap");
    }
  }
  uint64_t near = 0;
  for (const uint16_t n : c.near_counts) near += n;
  if (near != c.near_texels.size()) return corrupt("cell", "its near texels do not match their counts");
  for (const uint32_t texel : c.near_texels) {
    if (texel >= codes) return corrupt("cell", "a near texel lies outside its object's lightmap");
  }
  for (const uint32_t p : probes) {
    if (p >= c.probe_count) return corrupt("cell", "a probe index is out of range");
  }
  if (!std::all_of(correction.begin(), correction.end(), [](float v) { return std::isfinite(v); }) ||
      !std::all_of(projection.begin(), projection.end(), finite_half) ||
      !std::all_of(reconstruction.begin(), reconstruction.end(), finite_half)) {
    return corrupt("cell", "a coefficient is not finite");
  }

  const uint64_t stride = static_cast<uint64_t>(sh_stride(static_cast<int>(c.order)));
  uint64_t receiver = 0, probe = 0, column = 0, p_at = 0, r_at = 0;
  for (const ClusterRecord& k : records) {
    if (k.first_receiver != receiver || k.receivers == 0) return corrupt("cell", "its clusters do not follow on");
    const uint64_t p_rows = static_cast<uint64_t>(k.rank) * k.probes;
    const uint64_t r_size = k.rank * rounded_up_to_8(k.receivers);
    if (receiver + k.receivers > c.receivers.size() || probe + k.probes > probes.size() ||
        column + k.rank > correction.size() || p_rows > (projection.size() - p_at) / stride ||
        r_size > reconstruction.size() - r_at) {
      return corrupt("cell", "a cluster reaches past the chunk's arrays");
    }
    if (k.rank > 0 && k.probes == 0) return corrupt("cell", "a cluster has columns but no probes");
    if (!is_finite(k.lo) || !is_finite(k.hi) || !std::isfinite(k.error)) {
      return corrupt("cell", "a cluster's bounds or error are not finite");
    }
    if (k.lo.x > k.hi.x || k.lo.y > k.hi.y || k.lo.z > k.hi.z) return corrupt("cell", "a cluster's bounds are empty");
    const uint64_t p_size = p_rows * stride;
    const auto slice = [](const auto& v, uint64_t from, uint64_t n) {
      return std::decay_t<decltype(v)>(v.begin() + static_cast<int64_t>(from),
                                       v.begin() + static_cast<int64_t>(from + n));
    };
    CellChunk::Cluster out;
    out.first_receiver = k.first_receiver;
    out.receivers = k.receivers;
    out.probes = slice(probes, probe, k.probes);
    out.correction = slice(correction, column, k.rank);
    out.projection = slice(projection, p_at, p_size);
    out.reconstruction = slice(reconstruction, r_at, r_size);
    out.bounds = {k.lo, k.hi};
    out.error = k.error;
    c.clusters.push_back(std::move(out));
    receiver += k.receivers;
    probe += k.probes;
    column += k.rank;
    p_at += p_size;
    r_at += r_size;
  }
  if (receiver != c.receivers.size() || probe != probes.size() || column != correction.size() ||
      p_at != projection.size() || r_at != reconstruction.size()) {
    return corrupt("cell", "its clusters do not cover its arrays");
  }
  return c;
}

std::vector<uint8_t> encode_relight(const RelightChunk& c) {
  ByteWriter w;
  w.value(RelightHeader{kRelightMagic, kRelightVersion, static_cast<uint32_t>(c.objects.size()),
                        static_cast<uint32_t>(c.rays.size()), c.position, 0});
  w.array(c.objects);
  w.array(c.rays);
  return std::move(w).take();
}

absl::StatusOr<RelightChunk> decode_relight(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<RelightHeader>();
  if (header.magic != kRelightMagic) return corrupt("relight", "it does not start with LLCR");
  if (header.version != kRelightVersion)
    return corrupt("relight", absl::StrCat("version ", header.version, " is unknown"));
  RelightChunk c;
  c.position = header.position;
  c.objects = r.array<ChunkObject>(header.objects);
  c.rays = r.array<uint32_t>(header.rays);
  if (!r.at_end()) return corrupt("relight", "its length does not match its counts");
  if (!is_finite(c.position)) return corrupt("relight", "the probe's position is not finite");
  LL_ASSIGN_OR_RETURN(const uint64_t codes, check_objects("relight", c.objects));
  for (const uint32_t ray : c.rays) {
    if (ray != RelightChunk::kDead && ray != RelightChunk::kSky && ray >= codes) {
      return corrupt("relight", "a ray points outside its objects' lightmaps");
    }
  }
  return c;
}

std::vector<uint8_t> encode_surface(const SurfaceChunk& c) {
  LL_CHECK(c.positions.size() == c.keys.size() && c.normals.size() == c.keys.size() && c.areas.size() == c.keys.size());
  std::vector<uint32_t> normals;
  normals.reserve(c.normals.size());
  for (const Vec3 n : c.normals) normals.push_back(encode_normal(n));
  ByteWriter w;
  w.value(SurfaceHeader{kSurfaceMagic, kSurfaceVersion, static_cast<uint32_t>(c.keys.size()), 0, c.object});
  w.array(c.keys);
  w.array(c.positions);
  w.array(normals);
  w.array(c.areas);
  return std::move(w).take();
}

absl::StatusOr<SurfaceChunk> decode_surface(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<SurfaceHeader>();
  if (header.magic != kSurfaceMagic) return corrupt("surface", "it does not start with LLCS");
  if (header.version != kSurfaceVersion)
    return corrupt("surface", absl::StrCat("version ", header.version, " is unknown"));
  SurfaceChunk c;
  c.object = header.object;
  c.keys = r.array<uint32_t>(header.texels);
  c.positions = r.array<Vec3>(header.texels);
  const auto normals = r.array<uint32_t>(header.texels);
  c.areas = r.array<float>(header.texels);
  if (!r.at_end()) return corrupt("surface", "its length does not match its counts");
  if (!valid_object(c.object)) return corrupt("surface", "the lightmap size is out of range");
  for (size_t i = 0; i < c.keys.size(); ++i) {
    if (c.keys[i] >= texel_keys(c.object) || (i > 0 && c.keys[i] <= c.keys[i - 1])) {
      return corrupt("surface", "its texels are not sorted keys of its lightmap");
    }
    if (!is_finite(c.positions[i]) || !std::isfinite(c.areas[i])) {
      return corrupt("surface", "a position or area is not finite");
    }
  }
  c.normals.reserve(normals.size());
  for (const uint32_t n : normals) c.normals.push_back(decode_normal(n));
  return c;
}

}  // namespace lightloom
