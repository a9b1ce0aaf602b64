#include "runtime/detail.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/sh.h"

namespace lightloom {
namespace {

/// Rays of a coarse set. A head's few columns look at low bands only.
constexpr uint32_t kCoarseRays = 256;

double turn(double x) { return x - std::floor(x); }

void keep_greatest_near_texels(SourceCell* cell) {
  CellChunk& chunk = cell->chunk;
  size_t from = 0, to = 0;
  for (uint16_t& count : chunk.near_counts) {
    if (count == 0) continue;
    const auto first = chunk.near_weights.begin() + static_cast<ptrdiff_t>(from), end = first + count;
    const size_t greatest = static_cast<size_t>(std::max_element(first, end) - chunk.near_weights.begin());
    const uint32_t sum = std::accumulate(first, end, 0u);
    chunk.near_texels[to] = chunk.near_texels[greatest];
    cell->near_elements[to] = cell->near_elements[greatest];
    chunk.near_weights[to] = static_cast<uint16_t>(std::min(sum, 65535u));  // rounding may exceed it
    ++to;
    from += count;
    count = 1;
  }
  chunk.near_texels.resize(to);
  cell->near_elements.resize(to);
  chunk.near_weights.resize(to);
}

}  // namespace

void limit(SourceCell* cell, const Detail& detail) {
  if (detail.base) keep_greatest_near_texels(cell);
  CellChunk* const chunk = &cell->chunk;
  const size_t stride = static_cast<size_t>(sh_stride(static_cast<int>(chunk->order)));
  const bool all_bands = detail.bands > chunk->order;
  chunk->order = std::min(chunk->order, std::max(detail.bands, 1u) - 1);
  const size_t count = static_cast<size_t>(sh_count(static_cast<int>(chunk->order)));
  const size_t new_stride = static_cast<size_t>(sh_stride(static_cast<int>(chunk->order)));
  for (CellChunk::Cluster& c : chunk->clusters) {
    const size_t rank = std::min(c.rank(), detail.max_rank);
    if (rank == c.rank() && all_bands) continue;
    c.correction.resize(rank);
    c.reconstruction.resize(rank * ((c.receivers + size_t{7}) / 8 * 8));
    std::vector<Half> projection(rank * c.probes.size() * new_stride);
    for (size_t row = 0; row < rank * c.probes.size(); ++row) {
      std::copy_n(c.projection.begin() + static_cast<ptrdiff_t>(row * stride), count,
                  projection.begin() + static_cast<ptrdiff_t>(row * new_stride));
    }
    c.projection = std::move(projection);
  }
}

std::vector<uint32_t> every_ray(uint32_t rays) {
  std::vector<uint32_t> all(rays);
  std::iota(all.begin(), all.end(), 0);
  return all;
}

std::vector<uint32_t> coarse_rays(uint32_t rays) {
  if (rays < 2 * kCoarseRays) return every_ray(rays);
  // Azimuth of ray i, in turns (core/base/sh.h).
  constexpr double kGolden = 0.6180339887498948;
  std::vector<uint32_t> chosen;
  for (uint32_t m = 0; m < kCoarseRays; ++m) {
    const uint32_t first = static_cast<uint32_t>(uint64_t{rays} * m / kCoarseRays);
    const uint32_t last = static_cast<uint32_t>(uint64_t{rays} * (m + 1) / kCoarseRays);
    const auto distance = [&](uint32_t ray) {
      const double d = turn(kGolden * ray - kGolden * m);
      return std::min(d, 1 - d);
    };
    uint32_t best = first;
    for (uint32_t ray = first + 1; ray < last; ++ray) {
      if (distance(ray) < distance(best)) best = ray;
    }
    chosen.push_back(best);
  }
  return chosen;
}

}  // namespace lightloom
