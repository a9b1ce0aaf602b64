#include "core/asset/manifest.h"

#include <zlib.h>

#include <cmath>
#include <string_view>

#include "core/asset/chunk.h"
#include "core/base/bytes.h"
#include "core/base/sh.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

constexpr uint32_t kMagic = 0x4d4f4f4cu;  // "LOOM"
constexpr uint32_t kVersion = 5;

struct Header {
  uint32_t magic, version;
  uint32_t objects, probes, cells, clusters, cell_probes, strings;
  Digest scene_hash;
  BakeParams params;
  uint32_t layout_mode;
  int32_t width, height;
  uint32_t method_version_bytes;  // the first of `strings`; object names follow, back to back
  Vec3 lo, hi;
};
struct ObjectRecord {
  Digest id;
  int32_t width, height, x, y;
  Digest surface;
  uint64_t surface_size;
  uint32_t name_bytes, reserved;
};
struct ProbeRecord {
  Vec3 position;
  GridCell cell;
  uint32_t slot, reserved;
  Digest relight;
  uint64_t relight_size;
};
struct CellRecord {
  int32_t level;
  GridCell cell;
  Vec3 lo, hi;
  uint32_t receivers, first_cluster, clusters, first_probe, probes;
  float error, unseen, stale;
  Digest chunk;
  uint64_t chunk_size;
};
struct ClusterRecord {
  Vec3 lo, hi;
  uint32_t receivers, rank, probes;
  float error;
};
static_assert(sizeof(BakeParams) == 64 && sizeof(Header) == 168 && sizeof(ObjectRecord) == 96 &&
              sizeof(ProbeRecord) == 72 && sizeof(CellRecord) == 112 && sizeof(ClusterRecord) == 40);

uint32_t crc(std::span<const uint8_t> bytes) {
  uLong c = crc32(0, nullptr, 0);
  while (!bytes.empty()) {  // zlib counts in 32 bits
    const auto part = bytes.first(std::min<size_t>(bytes.size(), 1u << 30));
    c = crc32(c, part.data(), static_cast<uInt>(part.size()));
    bytes = bytes.subspan(part.size());
  }
  return static_cast<uint32_t>(c);
}

absl::Status corrupt(std::string_view why) {
  return absl::DataLossError("manifest is corrupt: " + std::string(why) + "; bake again or restore it");
}

bool valid(const BakeParams& p) {
  return p.method <= BakeMethod::kSl17 && p.probes >= 0 && p.order >= 0 && p.order <= kMaxShOrder && p.spacing > 0 &&
         std::isfinite(p.spacing) && p.near_field >= 0 && std::isfinite(p.near_field) && p.links >= 1 && p.rays >= 1 &&
         p.relight_rays >= 1 && p.max_rank >= 0 && p.threshold >= 0 && std::isfinite(p.threshold) && p.average >= 0 &&
         std::isfinite(p.average) && p.cell_receivers >= 1 && p.texels_per_metre >= 0 &&
         std::isfinite(p.texels_per_metre) && p.lightmap_size >= 0;
}

bool is_finite(const Aabb& box) { return is_finite(box.lo) && is_finite(box.hi); }

bool in_range(uint32_t first, uint32_t count, size_t size) { return first <= size && count <= size - first; }

absl::Status validate(const Manifest& m) {
  if (!valid(m.params)) return corrupt("a parameter is out of range");
  if (m.width < 0 || m.height < 0 || m.width > 1 << 16 || m.height > 1 << 16) {
    return corrupt("the lightmap image's size is out of range");
  }
  if (m.layout_mode > 1) return corrupt("its layout mode is unknown");
  if (!is_finite(m.bounds) && !(m.bounds.lo == Aabb{}.lo && m.bounds.hi == Aabb{}.hi))
    return corrupt("its bounds are not finite");
  for (const ObjectEntry& o : m.objects) {
    if (o.width < 0 || o.height < 0 || o.x < 0 || o.y < 0 || o.width > m.width - o.x || o.height > m.height - o.y) {
      return corrupt("object '" + printable(o.name) + "' lies outside the lightmap image");
    }
    constexpr auto kLargest = static_cast<int32_t>(kMaxObjectSide);
    if (o.width > kLargest || o.height > kLargest || (o.surface.size > 0 && (o.width == 0 || o.height == 0))) {
      return corrupt("the lightmap of object '" + printable(o.name) + "' has a size that is out of range");
    }
  }
  for (const ProbeEntry& p : m.probes) {
    if (!is_finite(p.position)) return corrupt("a probe's position is not finite");
  }
  uint32_t cluster = 0;
  for (const CellEntry& c : m.cells) {
    if (c.first_cluster != cluster || !in_range(c.first_cluster, c.clusters, m.clusters.size()) ||
        !in_range(c.first_probe, c.probes, m.cell_probes.size())) {
      return corrupt("a cell's clusters or probes are out of range");
    }
    if (!is_finite(c.bounds) || !std::isfinite(c.error) || !std::isfinite(c.unseen)) {
      return corrupt("a cell's bounds or quality are not finite");
    }
    if (!(c.stale >= 0 && c.stale <= 1)) return corrupt("a cell's staleness is out of range");
    cluster += c.clusters;
  }
  if (cluster != m.clusters.size()) return corrupt("clusters without a cell");
  for (const ClusterEntry& c : m.clusters) {
    if (!is_finite(c.bounds) || !std::isfinite(c.error)) return corrupt("a cluster's bounds or error are not finite");
  }
  for (const uint32_t p : m.cell_probes) {
    if (p >= m.probes.size()) return corrupt("a cell names a probe that is not there");
  }
  return absl::OkStatus();
}

}  // namespace

std::vector<ChunkRef> chunks_of(const Manifest& m) {
  std::vector<ChunkRef> chunks;
  for (const ObjectEntry& o : m.objects) chunks.push_back(o.surface);
  for (const ProbeEntry& p : m.probes) chunks.push_back(p.relight);
  for (const CellEntry& c : m.cells) chunks.push_back(c.chunk);
  std::erase_if(chunks, [](const ChunkRef& c) { return c.size == 0; });
  return chunks;
}

std::vector<uint8_t> encode_manifest(const Manifest& m) {
  std::string strings = m.method_version;
  std::vector<ObjectRecord> objects;
  for (const ObjectEntry& o : m.objects) {
    objects.push_back(
        {o.id, o.width, o.height, o.x, o.y, o.surface.digest, o.surface.size, static_cast<uint32_t>(o.name.size()), 0});
    strings += o.name;
  }
  std::vector<ProbeRecord> probes;
  for (const ProbeEntry& p : m.probes) {
    probes.push_back({p.position, p.cell, p.slot, 0, p.relight.digest, p.relight.size});
  }
  std::vector<CellRecord> cells;
  for (const CellEntry& c : m.cells) {
    cells.push_back({c.level, c.cell, c.bounds.lo, c.bounds.hi, c.receivers, c.first_cluster, c.clusters, c.first_probe,
                     c.probes, c.error, c.unseen, c.stale, c.chunk.digest, c.chunk.size});
  }
  std::vector<ClusterRecord> clusters;
  for (const ClusterEntry& c : m.clusters) {
    clusters.push_back({c.bounds.lo, c.bounds.hi, c.receivers, c.rank, c.probes, c.error});
  }

  Header header{};
  header.magic = kMagic;
  header.version = kVersion;
  header.objects = static_cast<uint32_t>(objects.size());
  header.probes = static_cast<uint32_t>(probes.size());
  header.cells = static_cast<uint32_t>(cells.size());
  header.clusters = static_cast<uint32_t>(clusters.size());
  header.cell_probes = static_cast<uint32_t>(m.cell_probes.size());
  header.strings = static_cast<uint32_t>(strings.size());
  header.scene_hash = m.scene_hash;
  header.params = m.params;
  header.layout_mode = m.layout_mode;
  header.width = m.width;
  header.height = m.height;
  header.method_version_bytes = static_cast<uint32_t>(m.method_version.size());
  header.lo = m.bounds.lo;
  header.hi = m.bounds.hi;

  ByteWriter w;
  w.value(header);
  w.array(objects);
  w.array(probes);
  w.array(cells);
  w.array(clusters);
  w.array(m.cell_probes);
  w.array(std::vector<char>(strings.begin(), strings.end()));
  w.align();
  std::vector<uint8_t> bytes = std::move(w).take();
  const uint32_t sum = crc(bytes);
  bytes.insert(bytes.end(), reinterpret_cast<const uint8_t*>(&sum), reinterpret_cast<const uint8_t*>(&sum) + 4);
  return bytes;
}

absl::StatusOr<Manifest> decode_manifest(std::span<const uint8_t> bytes) {
  if (bytes.size() < sizeof(Header) + 4) return corrupt("it is too short");
  const auto body = bytes.first(bytes.size() - 4);
  ByteReader r(body);
  const auto header = r.value<Header>();
  if (header.magic != kMagic) return corrupt("it does not start with LOOM");
  if (header.version != kVersion) {
    return absl::UnimplementedError("manifest has version " + std::to_string(header.version) +
                                    ", this program reads version " + std::to_string(kVersion) +
                                    "; bake again, or use the lightloom that fits");
  }
  uint32_t sum = 0;
  std::memcpy(&sum, bytes.data() + body.size(), 4);
  if (sum != crc(body)) return corrupt("its CRC does not match");

  const auto objects = r.array<ObjectRecord>(header.objects);
  const auto probes = r.array<ProbeRecord>(header.probes);
  const auto cells = r.array<CellRecord>(header.cells);
  const auto clusters = r.array<ClusterRecord>(header.clusters);
  Manifest m;
  m.cell_probes = r.array<uint32_t>(header.cell_probes);
  const auto strings = r.array<char>(header.strings);
  r.align();
  if (!r.at_end()) return corrupt("its length does not match its counts");

  size_t at = 0;
  bool strings_ok = true;
  const auto next_string = [&](uint32_t size) {
    if (size > strings.size() - at) {
      strings_ok = false;
      return std::string();
    }
    at += size;
    return std::string(strings.data() + at - size, size);
  };
  m.method_version = next_string(header.method_version_bytes);
  m.scene_hash = header.scene_hash;
  m.params = header.params;
  m.layout_mode = header.layout_mode;
  m.width = header.width;
  m.height = header.height;
  m.bounds = {header.lo, header.hi};
  for (const ObjectRecord& o : objects) {
    m.objects.push_back({o.id, next_string(o.name_bytes), o.width, o.height, o.x, o.y, {o.surface, o.surface_size}});
  }
  if (!strings_ok || at != strings.size()) return corrupt("its strings do not match their sizes");
  for (const ProbeRecord& p : probes) m.probes.push_back({p.position, p.cell, p.slot, {p.relight, p.relight_size}});
  for (const CellRecord& c : cells) {
    m.cells.push_back({c.level,
                       c.cell,
                       {c.lo, c.hi},
                       c.receivers,
                       c.first_cluster,
                       c.clusters,
                       c.first_probe,
                       c.probes,
                       {c.chunk, c.chunk_size},
                       c.error,
                       c.unseen,
                       c.stale});
  }
  for (const ClusterRecord& c : clusters) m.clusters.push_back({{c.lo, c.hi}, c.receivers, c.rank, c.probes, c.error});
  LL_RETURN_IF_ERROR(validate(m));
  return m;
}

}  // namespace lightloom
