// Region growing by normal as in Lévy, Petitjean, Ray & Maillot, "Least Squares Conformal Maps", SIGGRAPH
// 2002, section 3, reduced to planar proxies: one step of the relaxation of Cohen-Steiner, Alliez & Desbrun,
// "Variational Shape Approximation", SIGGRAPH 2004, turns the seed's normal into that of its surroundings.
#include "core/receivers/charts.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace lightloom {
namespace {

// How far the surroundings are explored for the axis. Bounds the work on meshes where little of what was
// explored can be kept.
constexpr size_t kSurroundings = 4096;

/// Breadth-first growth from a seed over unassigned triangles.
class Grower {
 public:
  explicit Grower(const MeshTopology& mesh) : mesh_(mesh), seen_(mesh.area.size(), 0) {}

  std::vector<uint32_t> grow(uint32_t seed, Vec3 axis, float min_cos, size_t limit, const std::vector<bool>& taken) {
    ++round_;
    std::vector<uint32_t> reached{seed};
    seen_[seed] = round_;
    for (size_t i = 0; i < reached.size(); ++i) {
      for (uint32_t next : mesh_.neighbours[reached[i]]) {
        if (reached.size() >= limit) return reached;
        if (next == MeshTopology::kNone || taken[next] || seen_[next] == round_) continue;
        if (!(dot(mesh_.normal[next], axis) > min_cos)) continue;
        seen_[next] = round_;
        reached.push_back(next);
      }
    }
    return reached;
  }

 private:
  const MeshTopology& mesh_;
  std::vector<uint32_t> seen_;  // round in which a triangle was last reached
  uint32_t round_ = 0;
};

Vec3 average_normal(const MeshTopology& mesh, const std::vector<uint32_t>& triangles) {
  double x = 0, y = 0, z = 0;
  for (uint32_t t : triangles) {
    x += mesh.area[t] * mesh.normal[t].x;
    y += mesh.area[t] * mesh.normal[t].y;
    z += mesh.area[t] * mesh.normal[t].z;
  }
  const double l = std::sqrt(x * x + y * y + z * z);
  return {static_cast<float>(x / l), static_cast<float>(y / l), static_cast<float>(z / l)};
}

}  // namespace

std::vector<Chart> grow_charts(const MeshTopology& mesh, float max_angle_cos) {
  std::vector<uint32_t> seeds(mesh.area.size());
  std::iota(seeds.begin(), seeds.end(), 0u);
  std::erase_if(seeds, [&](uint32_t t) { return mesh.degenerate(t); });
  std::stable_sort(seeds.begin(), seeds.end(), [&](uint32_t a, uint32_t b) { return mesh.area[a] > mesh.area[b]; });

  std::vector<Chart> charts;
  std::vector<bool> taken(mesh.area.size(), false);
  Grower grower(mesh);
  for (uint32_t seed : seeds) {
    if (taken[seed]) continue;
    // Normals within a cone average to one within it, so the seed stays in its own chart.
    Chart chart;
    chart.axis = average_normal(mesh, grower.grow(seed, mesh.normal[seed], max_angle_cos, kSurroundings, taken));
    chart.triangles = grower.grow(seed, chart.axis, max_angle_cos, mesh.area.size(), taken);
    for (uint32_t t : chart.triangles) taken[t] = true;
    charts.push_back(std::move(chart));
  }
  return charts;
}

}  // namespace lightloom
