#include "runtime/streaming/sight.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <utility>

#include "core/base/sh.h"
#include "runtime/detail.h"

namespace lightloom {
namespace {

constexpr uint32_t kNoCell = UINT32_MAX;
constexpr float kSky = 65504;
/// Probes around the eye that are asked.
constexpr size_t kProbes = 24;
/// How much is believed of a probe that does not see the eye.
constexpr float kHidden = 0.05f;
/// Of a cell around the eye, whether it is seen or not.
constexpr float kByDistance = 0.02f;

float squared_distance(Vec3 p, const Aabb& box) {
  float sum = 0;
  for (int a = 0; a < 3; ++a) {
    const float outside = std::max({box.lo[a] - p[a], 0.0f, p[a] - box.hi[a]});
    sum += outside * outside;
  }
  return sum;
}

auto place_of(const AssetIndex::Cell& c) { return std::pair(c.level, c.place); }

}  // namespace

Sight::Sight(const AssetIndex& index)
    : index_(index),
      coarse_(coarse_rays(index.rays())),
      positions_(index.surface_elements()),
      cell_of_(index.surface_elements(), kNoCell),
      by_place_(index.cells().size()),
      probes_(index.probes().size()) {
  for (const uint32_t r : coarse_) directions_.push_back(sphere_direction(r, index.rays()));
  for (const AssetIndex::Cell& c : index.cells()) levels_.push_back(c.level);
  std::sort(levels_.begin(), levels_.end());
  levels_.erase(std::unique(levels_.begin(), levels_.end()), levels_.end());
  std::iota(by_place_.begin(), by_place_.end(), 0);
  std::sort(by_place_.begin(), by_place_.end(),
            [&](uint32_t a, uint32_t b) { return place_of(index.cells()[a]) < place_of(index.cells()[b]); });
}

uint32_t Sight::find_cell(Vec3 position) const {
  for (const int32_t level : levels_) {
    const double side = cell_side(index_.spacing(), level);
    const auto along = [&](int axis) {
      constexpr double kFarthest = INT32_MAX;
      return static_cast<int32_t>(
          std::clamp(std::floor(static_cast<double>(position[axis]) / side), -kFarthest, kFarthest));
    };
    const std::pair place(level, GridCell{along(0), along(1), along(2)});
    const auto it = std::lower_bound(by_place_.begin(), by_place_.end(), place,
                                     [&](uint32_t c, const auto& p) { return place_of(index_.cells()[c]) < p; });
    if (it != by_place_.end() && place_of(index_.cells()[*it]) == place) return *it;
  }
  return kNoCell;
}

void Sight::add_surface(uint32_t object, std::span<const Vec3> positions) {
  const uint32_t first = index_.objects()[object].first_element;
  for (size_t i = 0; i < positions.size(); ++i) {
    positions_[first + i] = positions[i];
    cell_of_[first + i] = find_cell(positions[i]);
  }
}

void Sight::add_probe(uint32_t probe, std::span<const uint32_t> rays) {
  Probe& p = probes_[probe];
  std::vector<uint32_t> cells;
  for (const uint32_t element : rays) {
    if (element < cell_of_.size() && cell_of_[element] != kNoCell) cells.push_back(cell_of_[element]);
  }
  std::sort(cells.begin(), cells.end());
  p.cells.clear();
  for (size_t i = 0; i < cells.size();) {
    const size_t end = static_cast<size_t>(std::upper_bound(cells.begin(), cells.end(), cells[i]) - cells.begin());
    p.cells.push_back({cells[i], static_cast<float>(end - i) / static_cast<float>(rays.size())});
    i = end;
  }
  const Vec3 from = index_.probes()[probe].position;
  p.free.clear();
  for (const uint32_t r : coarse_) {
    const uint32_t element = rays[r];
    const bool ends = element < positions_.size();
    p.free.push_back(float_to_half(ends                            ? std::min(kSky, length(positions_[element] - from))
                                   : element == RelightChunk::kSky ? kSky
                                                                   : 0));
  }
}

/// By the ray that goes nearest to the eye.
bool Sight::sees(uint32_t probe, Vec3 eye, float distance) const {
  const Vec3 to = eye - index_.probes()[probe].position;
  size_t nearest = 0;
  for (size_t d = 1; d < directions_.size(); ++d) {
    if (dot(directions_[d], to) > dot(directions_[nearest], to)) nearest = d;
  }
  return half_to_float(probes_[probe].free[nearest]) > 0.9f * distance;
}

std::vector<float> Sight::importance(Vec3 eye) const {
  // The probes nearest to the eye, nearest first; ties by number.
  struct Near {
    float distance2;
    uint32_t probe;
  };
  std::vector<Near> nearest;
  for (uint32_t p = 0; p < probes_.size(); ++p) {
    if (probes_[p].cells.empty()) continue;
    const Vec3 to = index_.probes()[p].position - eye;
    nearest.push_back({dot(to, to), p});
  }
  const auto nearer = [](const Near& a, const Near& b) {
    return a.distance2 != b.distance2 ? a.distance2 < b.distance2 : a.probe < b.probe;
  };
  const size_t asked = std::min(kProbes, nearest.size());
  std::partial_sort(nearest.begin(), nearest.begin() + static_cast<ptrdiff_t>(asked), nearest.end(), nearer);
  std::vector<float> trust(asked);
  for (size_t i = 0; i < asked; ++i) {
    trust[i] = 1 / (0.1f + nearest[i].distance2);
    if (!sees(nearest[i].probe, eye, std::sqrt(nearest[i].distance2))) trust[i] *= kHidden;
  }
  const float trusts = std::accumulate(trust.begin(), trust.end(), 0.0f);

  std::vector<float> seen(index_.cells().size());
  for (size_t i = 0; i < asked; ++i) {
    const Vec3 probe = index_.probes()[nearest[i].probe].position;
    for (const Seen& s : probes_[nearest[i].probe].cells) {
      // The same surface seen from the eye.
      const Aabb& box = index_.cells()[s.cell].bounds;
      const Vec3 middle = (box.lo + box.hi) * 0.5f;
      const float closer = dot(middle - probe, middle - probe) / std::max(1e-6f, dot(middle - eye, middle - eye));
      seen[s.cell] += trust[i] / trusts * std::min(4.0f, closer) * s.share;
    }
  }
  for (uint32_t c = 0; c < seen.size(); ++c) {
    seen[c] = std::sqrt(seen[c]) + kByDistance / (1 + squared_distance(eye, index_.cells()[c].bounds));
  }
  return seen;
}

}  // namespace lightloom
