#include "core/probes/density_thinning.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <queue>

#include "core/probes/links.h"

namespace lightloom {
namespace {

/// Points by cells of a grid as wide as the radius of the queries.
class Neighbours {
 public:
  Neighbours(const std::vector<Vec3>& points, float radius) : points_(points), radius_(radius) {
    for (uint32_t i = 0; i < points.size(); ++i) cells_[cell_of(points[i])].push_back(i);
  }
  /// Calls f(j, w(|p_i − p_j|/radius)) for every j ≠ i with a weight, in a fixed order.
  template <class F>
  void for_each(uint32_t i, const F& f) const {
    const Cell home = cell_of(points_[i]);
    for (int32_t dx = -1; dx <= 1; ++dx) {
      for (int32_t dy = -1; dy <= 1; ++dy) {
        for (int32_t dz = -1; dz <= 1; ++dz) {
          const auto it = cells_.find({home[0] + dx, home[1] + dy, home[2] + dz});
          if (it == cells_.end()) continue;
          for (const uint32_t j : it->second) {
            const float w = spatial_weight(length(points_[j] - points_[i]) / radius_);
            if (j != i && w > 0) f(j, static_cast<double>(w));
          }
        }
      }
    }
  }

 private:
  using Cell = std::array<int32_t, 3>;
  Cell cell_of(Vec3 p) const {
    const auto index = [&](float x) { return static_cast<int32_t>(std::floor(x / radius_)); };
    return {index(p.x), index(p.y), index(p.z)};
  }

  const std::vector<Vec3>& points_;
  float radius_;
  std::map<Cell, std::vector<uint32_t>> cells_;
};

}  // namespace

std::vector<Vec3> thin_by_density(const std::vector<Vec3>& points, float radius, size_t count) {
  if (points.size() <= count) return points;
  const Neighbours neighbours(points, radius);
  std::vector<double> density(points.size(), 1.0);
  struct Dense {
    double density;
    uint32_t point;
    bool operator<(const Dense& o) const { return density != o.density ? density < o.density : point > o.point; }
  };
  std::priority_queue<Dense> densest;
  for (uint32_t i = 0; i < points.size(); ++i) {
    neighbours.for_each(i, [&](uint32_t, double w) { density[i] += w; });
    densest.push({density[i], i});
  }
  std::vector<bool> removed(points.size(), false);
  for (size_t left = points.size(); left > count;) {
    const Dense top = densest.top();
    densest.pop();
    // Densities only fall, so an entry that is out of date stands too far up: look again later.
    if (top.density != density[top.point]) {
      densest.push({density[top.point], top.point});
      continue;
    }
    removed[top.point] = true;
    --left;
    neighbours.for_each(top.point, [&](uint32_t j, double w) { density[j] -= w; });
  }
  std::vector<Vec3> out;
  for (uint32_t i = 0; i < points.size(); ++i) {
    if (!removed[i]) out.push_back(points[i]);
  }
  return out;
}

}  // namespace lightloom
