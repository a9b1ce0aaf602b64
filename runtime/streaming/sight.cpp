#include "runtime/streaming/sight.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "runtime/detail.h"

namespace lightloom {
namespace {

constexpr uint32_t kNoCell = UINT32_MAX;
/// Probes around the eye that are asked.
constexpr size_t kProbes = 8;
/// Of the whole importance, what goes by distance alone.
constexpr float kByDistance = 0.02f;

float squared_distance(Vec3 p, const Aabb& box) {
  float sum = 0;
  for (int a = 0; a < 3; ++a) {
    const float outside = std::max({box.lo[a] - p[a], 0.0f, p[a] - box.hi[a]});
    sum += outside * outside;
  }
  return sum;
}

}  // namespace

Sight::Sight(const AssetIndex& index)
    : index_(index), cell_of_(index.surface_elements(), kNoCell), rays_(index.probes().size()) {}

void Sight::add_cell(uint32_t cell, std::span<const uint32_t> elements) {
  for (const uint32_t e : elements) cell_of_[e] = cell;
}

void Sight::add_probe(uint32_t probe, std::span<const uint32_t> rays) {
  rays_[probe].clear();
  for (const uint32_t r : coarse_rays(index_.rays())) {
    if (rays[r] < cell_of_.size()) rays_[probe].push_back(rays[r]);
  }
}

std::vector<float> Sight::importance(Vec3 eye) const {
  // The probes nearest to the eye, nearest first; ties by number.
  struct Near {
    float distance2;
    uint32_t probe;
  };
  std::vector<Near> nearest;
  for (uint32_t p = 0; p < rays_.size(); ++p) {
    if (rays_[p].empty()) continue;
    const Vec3 to = index_.probes()[p].position - eye;
    nearest.push_back({dot(to, to), p});
  }
  const auto nearer = [](const Near& a, const Near& b) {
    return a.distance2 != b.distance2 ? a.distance2 < b.distance2 : a.probe < b.probe;
  };
  const size_t asked = std::min(kProbes, nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<ptrdiff_t>(asked), nearest.end(), nearer);

  std::vector<float> seen(index_.cells().size());
  float weights = 0;
  for (size_t i = 0; i < asked; ++i) weights += 1 / (0.1f + nearest[i].distance2);
  for (size_t i = 0; i < asked; ++i) {
    const std::vector<uint32_t>& rays = rays_[nearest[i].probe];
    const float weight =
        (1 - kByDistance) / ((0.1f + nearest[i].distance2) * weights * static_cast<float>(rays.size()));
    for (const uint32_t element : rays) {
      if (cell_of_[element] != kNoCell) seen[cell_of_[element]] += weight;
    }
  }

  float all = 0;
  std::vector<float> near(seen.size());
  for (uint32_t c = 0; c < seen.size(); ++c) {
    near[c] = 1 / (1 + squared_distance(eye, index_.cells()[c].bounds));
    all += near[c];
  }
  for (uint32_t c = 0; c < seen.size(); ++c) seen[c] += kByDistance * near[c] / all;
  return seen;
}

}  // namespace lightloom
