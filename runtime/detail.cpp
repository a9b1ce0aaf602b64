#include "runtime/detail.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/base/sh.h"

namespace lightloom {
namespace {

/// Rays of a coarse set. A head's few columns look at low bands only.
constexpr uint32_t kCoarseRays = 256;

double turn(double x) { return x - std::floor(x); }

}  // namespace

void limit_rank(CellChunk* chunk, uint32_t max_rank) {
  const size_t stride = static_cast<size_t>(sh_stride(static_cast<int>(chunk->order)));
  for (CellChunk::Cluster& c : chunk->clusters) {
    if (c.rank() <= max_rank) continue;
    c.correction.resize(max_rank);
    c.projection.resize(max_rank * c.probes.size() * stride);
    c.reconstruction.resize(max_rank * ((c.receivers + size_t{7}) / 8 * 8));
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
