#include "core/bake/cell_record.h"

#include <algorithm>
#include <cmath>
#include <string>
#include <string_view>

#include "core/base/bytes.h"

namespace lightloom {
namespace {

constexpr uint32_t kMagic = 0x5243424cu;  // "LBCR"
constexpr uint32_t kVersion = 3;

struct Header {
  uint32_t magic, version, probes, clusters;
  Digest key;
  ChunkRef chunk;
  Vec3 lo, hi;
  uint64_t gather_rays, unseen;
  double error;
  uint64_t coefficients, bytes_projection, bytes_reconstruction;
  float stale;
  uint32_t near_objects;
};
static_assert(sizeof(Header) == 168 && sizeof(ClusterEntry) == 40 && sizeof(ChunkRef) == 40);

absl::Status corrupt(std::string_view why) {
  return absl::DataLossError("cell record is corrupt: " + std::string(why) + "; run the cell's task again");
}

bool valid_box(const Aabb& b) {
  return is_finite(b.lo) && is_finite(b.hi) && b.lo.x <= b.hi.x && b.lo.y <= b.hi.y && b.lo.z <= b.hi.z;
}

uint64_t count_coefficients(const std::vector<ClusterEntry>& clusters) {
  uint64_t sum = 0;
  for (const ClusterEntry& k : clusters) sum += static_cast<uint64_t>(k.rank) * k.receivers;
  return sum;
}

}  // namespace

uint64_t CellRecord::receivers() const {
  uint64_t sum = 0;
  for (const ClusterEntry& k : clusters) sum += k.receivers;
  return sum;
}

std::vector<uint8_t> encode_cell_record(const CellRecord& c) {
  ByteWriter w;
  w.value(Header{kMagic, kVersion, static_cast<uint32_t>(c.probes.size()), static_cast<uint32_t>(c.clusters.size()),
                 c.key, c.chunk, c.bounds.lo, c.bounds.hi, c.gather_rays, c.unseen, c.error, c.coefficients,
                 c.bytes_projection, c.bytes_reconstruction, c.stale, static_cast<uint32_t>(c.near.size())});
  w.array(c.probes);
  w.array(c.clusters);
  for (const NearSurface& near : c.near) {
    w.value(near.object);
    w.value(static_cast<uint32_t>(near.keys.size()));
    w.array(near.keys);
  }
  write_trace(c.trace, &w);
  return std::move(w).take();
}

absl::StatusOr<CellRecord> decode_cell_record(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<Header>();
  if (header.magic != kMagic) return corrupt("it does not start with LBCR");
  if (header.version != kVersion) return corrupt("version " + std::to_string(header.version) + " is unknown");
  CellRecord c;
  c.probes = r.array<ProbeName>(header.probes);
  c.clusters = r.array<ClusterEntry>(header.clusters);
  for (uint32_t i = 0; i < header.near_objects && r.ok(); ++i) {
    NearSurface& near = c.near.emplace_back();
    near.object = r.value<ChunkObject>();
    near.keys = r.array<uint32_t>(r.value<uint32_t>());
  }
  auto trace = read_trace(&r);
  if (!r.at_end()) return corrupt("its length does not match its counts");
  if (!trace.ok()) return corrupt(std::string(trace.status().message()));
  c.trace = *std::move(trace);
  c.key = header.key;
  c.stale = header.stale;
  c.chunk = header.chunk;
  c.bounds = {header.lo, header.hi};
  c.gather_rays = header.gather_rays;
  c.unseen = header.unseen;
  c.error = header.error;
  c.coefficients = header.coefficients;
  c.bytes_projection = header.bytes_projection;
  c.bytes_reconstruction = header.bytes_reconstruction;

  if (c.clusters.empty()) return corrupt("it has no clusters");
  if (c.chunk.size == 0) return corrupt("it names no chunk");
  if (!valid_box(c.bounds)) return corrupt("its bounds are not finite or empty");
  if (!std::isfinite(c.error) || c.error < 0) return corrupt("its error is out of range");
  if (!(c.stale >= 0 && c.stale <= 1)) return corrupt("its staleness is out of range");
  if (c.unseen > c.gather_rays) return corrupt("more rays are unseen than were shot");
  if (std::adjacent_find(c.probes.begin(), c.probes.end(), std::greater_equal<>()) != c.probes.end()) {
    return corrupt("its probes do not ascend");
  }
  for (const NearSurface& near : c.near) {
    if (near.keys.empty() ||
        std::adjacent_find(near.keys.begin(), near.keys.end(), std::greater_equal<>()) != near.keys.end()) {
      return corrupt("texels of its near fields do not ascend");
    }
  }
  for (const ClusterEntry& k : c.clusters) {
    if (k.receivers == 0) return corrupt("a cluster has no receivers");
    if (k.probes > c.probes.size()) return corrupt("a cluster has more probes than the cell");
    if (k.rank > 0 && k.probes == 0) return corrupt("a cluster has columns but no probes");
    if (!valid_box(k.bounds)) return corrupt("a cluster's bounds are not finite or empty");
    if (!std::isfinite(k.error) || k.error < 0) return corrupt("a cluster's error is out of range");
  }
  if (c.receivers() > c.chunk.size) return corrupt("it has more receivers than its chunk has bytes");
  if (c.coefficients != count_coefficients(c.clusters)) return corrupt("its coefficients do not match its clusters");
  if (c.bytes_projection > c.chunk.size || c.bytes_reconstruction > c.chunk.size - c.bytes_projection) {
    return corrupt("its parts are larger than its chunk");
  }
  return c;
}

}  // namespace lightloom
