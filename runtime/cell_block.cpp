#include "runtime/cell_block.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "core/base/check.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

static_assert(gpu::kDead == RelightChunk::kDead && gpu::kSky == RelightChunk::kSky);

uint32_t octets_of(uint32_t receivers) { return (receivers + gpu::kOctet - 1) / gpu::kOctet; }
/// At least one job, which computes c_0.
uint32_t jobs_of(uint32_t rank) { return std::max(1u, (rank + gpu::kJobColumns - 1) / gpu::kJobColumns); }

/// Where each array of a block lies, bytes.
struct Places {
  uint64_t clusters, jobs, probes, corrections, octets, elements, uniforms, near_first, near, matrix, coefficients, end;
};

Places places_of(const SourceCell& cell) {
  uint64_t jobs = 0, probes = 0, ranks = 0, octets = 0, halfs = 0;
  for (const CellChunk::Cluster& c : cell.chunk.clusters) {
    jobs += jobs_of(c.rank());
    probes += c.probes.size();
    ranks += c.rank();
    octets += octets_of(c.receivers);
    halfs += c.projection.size() + c.reconstruction.size();
  }
  uint64_t at = sizeof(gpu::CellHeader);
  const auto place = [&at](uint64_t bytes) {
    const uint64_t start = at;
    at = (at + bytes + gpu::kCellUnit - 1) / gpu::kCellUnit * gpu::kCellUnit;
    return start;
  };
  Places p;
  p.clusters = place(cell.chunk.clusters.size() * sizeof(gpu::Cluster));
  p.jobs = place(jobs * sizeof(gpu::Job));
  p.probes = place(probes * sizeof(uint32_t));
  p.corrections = place(ranks * sizeof(float));
  p.octets = place(octets * sizeof(gpu::Octet));
  p.elements = place(octets * gpu::kOctet * sizeof(uint32_t));
  p.uniforms = place(octets * gpu::kOctet * sizeof(uint16_t));
  p.near_first = place((octets * gpu::kOctet + 1) * sizeof(uint32_t));
  p.near = place(cell.near_elements.size() * sizeof(gpu::NearTexel));
  p.matrix = place(halfs * sizeof(Half));
  p.coefficients = place((ranks + cell.chunk.clusters.size()) * 4 * sizeof(float));
  p.end = at;
  return p;
}

/// Writes records one after another.
class Writer {
 public:
  explicit Writer(uint8_t* to) : to_(to) {}
  template <class T>
  void put(const T& value) {
    put(&value, 1);
  }
  template <class T>
  void put(const T* values, size_t count) {
    if (count > 0) std::memcpy(to_, values, count * sizeof(T));
    to_ += count * sizeof(T);
  }
  void skip(uint64_t bytes) { to_ += bytes; }

 private:
  uint8_t* to_;
};

}  // namespace

absl::StatusOr<CellBlock> make_cell_block(const SourceCell& cell, uint64_t max_bytes,
                                          std::pmr::memory_resource* memory) {
  const Places at = places_of(cell);
  if (at.end > max_bytes) {
    return absl::UnimplementedError("cell needs " + std::to_string(at.end) + " bytes, a page has " +
                                    std::to_string(max_bytes) + "; bake with smaller cells or lower ranks");
  }
  CellBlock block{at.end, at.coefficients, 0, 0, 0, 0, std::pmr::vector<uint8_t>(at.coefficients, memory)};
  uint8_t* const data = block.data.data();
  const auto units = [](uint64_t bytes, uint64_t unit) { return static_cast<uint32_t>(bytes / unit); };
  Writer(data).put(gpu::CellHeader{units(at.clusters, sizeof(gpu::Cluster)),
                                   units(at.jobs, 4),
                                   units(at.probes, 4),
                                   units(at.corrections, 4),
                                   units(at.octets, 4),
                                   units(at.elements, 4),
                                   units(at.uniforms, 16),
                                   units(at.coefficients, 16),
                                   static_cast<uint32_t>(sh_stride(static_cast<int>(cell.chunk.order))) / 8,
                                   units(at.near_first, 4),
                                   units(at.near, 4),
                                   {}});
  Writer clusters(data + at.clusters), jobs(data + at.jobs), probes(data + at.probes);
  Writer corrections(data + at.corrections), octets(data + at.octets), elements(data + at.elements);
  Writer uniforms(data + at.uniforms), near_first(data + at.near_first), near(data + at.near), matrix(data + at.matrix);

  uint32_t index = 0, first_probe = 0, first_correction = 0, first_coefficient = 0;
  uint32_t quad = units(at.matrix, 16), near_end = 0;
  near_first.put(near_end);
  for (const CellChunk::Cluster& c : cell.chunk.clusters) {
    const uint32_t count = octets_of(c.receivers);
    const uint32_t projection = static_cast<uint32_t>(c.projection.size() / 8);
    clusters.put(gpu::Cluster{quad, quad + projection, first_probe, static_cast<uint32_t>(c.probes.size()),
                              first_correction, c.rank(), first_coefficient, count});
    quad += projection + static_cast<uint32_t>(c.reconstruction.size() / 8);
    first_probe += static_cast<uint32_t>(c.probes.size());
    first_correction += c.rank();
    first_coefficient += c.rank() + 1;

    for (uint32_t j = 0; j < jobs_of(c.rank()); ++j) jobs.put(gpu::Job{index, j * gpu::kJobColumns});
    for (const uint32_t p : c.probes) probes.put(cell.probes[p]);
    corrections.put(c.correction.data(), c.correction.size());
    for (uint32_t o = 0; o < count; ++o) octets.put(gpu::Octet{index, o});
    elements.put(cell.elements.data() + c.first_receiver, c.receivers);
    for (uint32_t pad = c.receivers; pad < count * gpu::kOctet; ++pad) elements.put(gpu::kNoElement);
    uniforms.put(cell.chunk.uniform.data() + c.first_receiver, c.receivers);
    uniforms.skip((count * gpu::kOctet - c.receivers) * sizeof(uint16_t));
    for (uint32_t r = 0; r < count * gpu::kOctet; ++r) {
      const uint32_t entries = r < c.receivers ? cell.chunk.near_counts[c.first_receiver + r] : 0;
      for (const uint32_t end = near_end + entries; near_end < end; ++near_end) {
        near.put(gpu::NearTexel{cell.near_elements[near_end],
                                kPi / 65535 * static_cast<float>(cell.chunk.near_weights[near_end])});
      }
      near_first.put(near_end);
    }
    matrix.put(c.projection.data(), c.projection.size());
    matrix.put(c.reconstruction.data(), c.reconstruction.size());

    ++index;
    block.jobs += jobs_of(c.rank());
    block.octets += count;
    block.projection_bytes += c.projection.size() * sizeof(Half);
    block.reconstruction_bytes += c.reconstruction.size() * sizeof(Half);
  }
  block.reconstruction_bytes += cell.near_elements.size() * kNearTexelBytes;
  return block;
}

std::pmr::vector<uint8_t> sh_table(uint32_t order, uint32_t rays, std::span<const uint32_t> chosen,
                                   std::pmr::memory_resource* memory) {
  const size_t stride = static_cast<size_t>(sh_stride(static_cast<int>(order)));
  const size_t padded = (chosen.size() + gpu::kRayTile - 1) / gpu::kRayTile * gpu::kRayTile;
  std::vector<float> table(padded * stride), y(stride);
  for (size_t r = 0; r < chosen.size(); ++r) {
    sh_evaluate(static_cast<int>(order), sphere_direction(chosen[r], rays), y);
    for (size_t j = 0; j < stride; ++j) table[(r / 4 * stride + j) * 4 + r % 4] = y[j];
  }
  std::pmr::vector<uint8_t> bytes(table.size() * sizeof(float), memory);
  if (!bytes.empty()) std::memcpy(bytes.data(), table.data(), bytes.size());
  return bytes;
}

}  // namespace lightloom
