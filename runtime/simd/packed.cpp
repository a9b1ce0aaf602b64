#include "runtime/simd/packed.h"

#include <algorithm>

#include "core/base/sh.h"

namespace lightloom::simd {

ClusterView PackedCell::view(const PackedCluster& c) const {
  ClusterView view;
  view.projection = projection.data() + c.projection;
  view.reconstruction = reconstruction.data() + c.reconstruction;
  view.uniform = uniform.data() + c.first;
  view.correction = correction.data() + c.correction;
  view.probes = probes.data() + c.probes;
  view.rank = c.rank;
  view.probe_count = c.probe_count;
  view.stride = stride;
  return view;
}

uint64_t PackedCell::bytes() const {
  return clusters.bytes() + projection.bytes() + reconstruction.bytes() + correction.bytes() + probes.bytes() +
         elements.bytes() + uniform.bytes() + near_first.bytes() + near_elements.bytes() + near_weights.bytes() +
         near_tiles.bytes() + coefficients.bytes();
}

namespace {

/// In the order of their surface elements, so that E is written in one sweep too. `near_first`: per receiver of the chunk and
/// one more.
void pack_receivers(const SourceCell& cell, const CellChunk::Cluster& c, std::span<const uint32_t> near_first,
                    const PackedCluster& to, PackedCell* packed) {
  std::vector<uint32_t> order(c.receivers);
  for (uint32_t r = 0; r < c.receivers; ++r) order[r] = r;
  const uint32_t* const elements = cell.elements.data() + c.first_receiver;
  std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) { return elements[a] < elements[b]; });

  const size_t column = (c.receivers + 7) / 8 * size_t{8};  // of the chunk
  uint16_t* const reconstruction = packed->reconstruction.data() + to.reconstruction;
  for (uint32_t r = 0; r < c.receivers; ++r) {
    packed->elements[to.first + r] = elements[order[r]];
    packed->uniform[to.first + r] = cell.chunk.uniform[c.first_receiver + order[r]];
    const size_t run = r / kReceiverAlign * size_t{to.rank};
    for (size_t k = 0; k < to.rank; ++k) {
      reconstruction[(run + k) * kReceiverAlign + r % kReceiverAlign] = c.reconstruction[k * column + order[r]];
    }
  }

  // Padding has none.
  uint32_t near = packed->near_first[to.first];
  for (uint32_t r = 0; r < to.padded; ++r) {
    if (r < c.receivers) {
      const uint32_t receiver = c.first_receiver + order[r];
      for (uint32_t n = near_first[receiver]; n < near_first[receiver + 1]; ++n, ++near) {
        const uint32_t element = cell.near_elements[n], tile = element / kTile;
        packed->near_elements[near] = element;
        packed->near_weights[near] = kPi / 65535 * static_cast<float>(cell.chunk.near_weights[n]);
        packed->near_tiles[tile / 64] |= uint64_t{1} << (tile % 64);
      }
    }
    packed->near_first[to.first + r + 1] = near;
  }
}

}  // namespace

PackedCell pack_cell(const SourceCell& cell, uint32_t surface_elements, bool full_bands,
                     std::pmr::memory_resource* memory) {
  PackedCell packed;
  // Kernels read a row in vectors. Where one reaches behind the last band, λ must be 0; with fewer bands than λ has, the
  // row is.
  const uint32_t stride = static_cast<uint32_t>(sh_stride(static_cast<int>(cell.chunk.order)));
  packed.stride = full_bands ? stride : (stride + kLambdaAlign - 1) / kLambdaAlign * kLambdaAlign;
  packed.clusters = Array<PackedCluster>(memory, cell.chunk.clusters.size());

  // Where each cluster's part begins, and how long the arrays become.
  PackedCluster end;
  for (size_t i = 0; i < cell.chunk.clusters.size(); ++i) {
    const CellChunk::Cluster& c = cell.chunk.clusters[i];
    PackedCluster& to = packed.clusters[i];
    to = end;
    to.probe_count = static_cast<uint32_t>(c.probes.size());
    to.rank = c.rank();
    to.receivers = c.receivers;
    to.padded = (c.receivers + kReceiverAlign - 1) / kReceiverAlign * kReceiverAlign;
    end.projection += c.projection.size() / stride * packed.stride;
    end.reconstruction += size_t{to.rank} * to.padded;
    end.probes += to.probe_count;
    end.correction += to.rank;
    end.coefficients += 4 * (to.rank + 1);
    end.first += to.padded;
  }
  packed.projection = Array<uint16_t>(memory, end.projection + kOverread);
  packed.reconstruction = Array<uint16_t>(memory, end.reconstruction);
  packed.correction = Array<float>(memory, end.correction);
  packed.probes = Array<uint32_t>(memory, end.probes);
  packed.elements = Array<uint32_t>(memory, end.first);
  packed.uniform = Array<uint16_t>(memory, end.first);
  packed.near_first = Array<uint32_t>(memory, end.first + size_t{1});
  packed.near_elements = Array<uint32_t>(memory, cell.near_elements.size());
  packed.near_weights = Array<float>(memory, cell.near_elements.size());
  packed.near_tiles = Array<uint64_t>(memory, tile_words(surface_elements));
  packed.coefficients = Array<float>(memory, end.coefficients);
  packed.projection_bytes = end.projection * sizeof(Half);
  packed.reconstruction_bytes = cell.near_elements.size() * kNearTexelBytes;

  std::vector<uint32_t> near_first = {0};
  for (const uint16_t count : cell.chunk.near_counts) near_first.push_back(near_first.back() + count);
  for (size_t i = 0; i < cell.chunk.clusters.size(); ++i) {
    const CellChunk::Cluster& c = cell.chunk.clusters[i];
    const PackedCluster& to = packed.clusters[i];
    for (size_t row = 0; row < c.projection.size() / stride; ++row) {
      std::copy_n(c.projection.begin() + static_cast<ptrdiff_t>(row * stride), stride,
                  packed.projection.data() + to.projection + row * packed.stride);
    }
    packed.reconstruction_bytes += c.reconstruction.size() * sizeof(Half);
    std::copy(c.correction.begin(), c.correction.end(), packed.correction.data() + to.correction);
    for (size_t p = 0; p < c.probes.size(); ++p) packed.probes[to.probes + p] = cell.probes[c.probes[p]];
    pack_receivers(cell, c, near_first, to, &packed);
  }
  return packed;
}

PackedProbe pack_probe(std::span<const uint32_t> rays, uint32_t surface_elements, std::pmr::memory_resource* memory) {
  PackedProbe packed;
  packed.elements = Array<uint32_t>(memory, rays.size());
  packed.tiles = Array<uint64_t>(memory, tile_words(surface_elements));
  for (size_t r = 0; r < rays.size(); ++r) {
    if (rays[r] == RelightChunk::kDead) {
      packed.elements[r] = dead_element(surface_elements);
    } else if (rays[r] == RelightChunk::kSky) {
      packed.elements[r] = sky_element(surface_elements);
      packed.sees_sky = true;
    } else {
      packed.elements[r] = rays[r];
      const uint32_t tile = rays[r] / kTile;
      packed.tiles[tile / 64] |= uint64_t{1} << (tile % 64);
    }
  }
  return packed;
}

}  // namespace lightloom::simd
