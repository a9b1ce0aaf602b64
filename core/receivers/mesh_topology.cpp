#include "core/receivers/mesh_topology.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>
#include <utility>

namespace lightloom {
namespace {

// A triangle lower than this fraction of its longest edge has a normal made of rounding errors.
constexpr double kNeedle = 1e-6;

struct Shape {
  double nx = 0, ny = 0, nz = 0;  // normal times twice the area
  double twice_area = 0;
  double longest2 = 0;  // of the edges, squared
};

Shape shape_of(const Object& object, const Triangle& triangle) {
  const Vec3 a = object.positions[triangle.v[0]];
  const Vec3 b = object.positions[triangle.v[1]];
  const Vec3 c = object.positions[triangle.v[2]];
  const double ux = double{b.x} - a.x, uy = double{b.y} - a.y, uz = double{b.z} - a.z;
  const double vx = double{c.x} - a.x, vy = double{c.y} - a.y, vz = double{c.z} - a.z;
  const double wx = vx - ux, wy = vy - uy, wz = vz - uz;
  Shape s;
  s.nx = uy * vz - uz * vy;
  s.ny = uz * vx - ux * vz;
  s.nz = ux * vy - uy * vx;
  s.twice_area = std::sqrt(s.nx * s.nx + s.ny * s.ny + s.nz * s.nz);
  s.longest2 = std::max({ux * ux + uy * uy + uz * uz, vx * vx + vy * vy + vz * vz, wx * wx + wy * wy + wz * wz});
  return s;
}

/// Per vertex, a number shared by all vertices with the same position.
std::vector<uint32_t> weld(const std::vector<Vec3>& positions) {
  const auto key = [&](uint32_t i) {
    const Vec3 p = positions[i];
    // Adding zero makes -0 and +0 one; bits order NaNs too.
    return std::array<uint32_t, 3>{std::bit_cast<uint32_t>(p.x + 0.0f), std::bit_cast<uint32_t>(p.y + 0.0f),
                                   std::bit_cast<uint32_t>(p.z + 0.0f)};
  };
  std::vector<uint32_t> order(positions.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(),
            [&](uint32_t a, uint32_t b) { return std::pair(key(a), a) < std::pair(key(b), b); });
  std::vector<uint32_t> welded(positions.size());
  for (size_t i = 0; i < order.size(); ++i) {
    const bool same = i > 0 && key(order[i]) == key(order[i - 1]);
    welded[order[i]] = same ? welded[order[i - 1]] : order[i];
  }
  return welded;
}

}  // namespace

MeshTopology build_topology(const Object& object) {
  const size_t n = object.triangles.size();
  MeshTopology mesh;
  mesh.normal.assign(n, {});
  mesh.area.assign(n, 0);
  mesh.neighbours.resize(n);
  for (auto& links : mesh.neighbours) links.fill(MeshTopology::kNone);

  for (size_t t = 0; t < n; ++t) {
    const Shape s = shape_of(object, object.triangles[t]);
    if (!std::isfinite(s.twice_area) || !std::isfinite(s.longest2)) continue;
    if (!(s.twice_area > kNeedle * s.longest2)) continue;
    mesh.area[t] = 0.5 * s.twice_area;
    mesh.normal[t] = {static_cast<float>(s.nx / s.twice_area), static_cast<float>(s.ny / s.twice_area),
                      static_cast<float>(s.nz / s.twice_area)};
  }

  struct Side {
    uint64_t edge;   // welded ends, smaller first
    uint32_t where;  // 3 · triangle + edge number
    auto operator<=>(const Side&) const = default;
  };
  const std::vector<uint32_t> welded = weld(object.positions);
  std::vector<Side> sides;
  sides.reserve(3 * n);
  for (uint32_t t = 0; t < n; ++t) {
    if (mesh.degenerate(t)) continue;
    for (uint32_t e = 0; e < 3; ++e) {
      const uint64_t a = welded[object.triangles[t].v[e]], b = welded[object.triangles[t].v[(e + 1) % 3]];
      sides.push_back({std::min(a, b) << 32 | std::max(a, b), 3 * t + e});
    }
  }
  std::sort(sides.begin(), sides.end());
  for (size_t i = 1; i < sides.size(); ++i) {
    if (sides[i].edge != sides[i - 1].edge) continue;
    const uint32_t p = sides[i - 1].where, q = sides[i].where;
    mesh.neighbours[p / 3][2 * (p % 3) + 1] = q / 3;
    mesh.neighbours[q / 3][2 * (q % 3)] = p / 3;
  }
  return mesh;
}

std::vector<std::vector<uint32_t>> connected_components(const MeshTopology& mesh,
                                                        const std::vector<uint32_t>& triangles,
                                                        std::vector<uint32_t>* label) {
  constexpr uint32_t kPending = MeshTopology::kNone - 1;
  for (uint32_t t : triangles) (*label)[t] = kPending;
  uint32_t count = 0;
  std::vector<uint32_t> stack;
  for (uint32_t start : triangles) {
    if ((*label)[start] != kPending) continue;
    (*label)[start] = count;
    stack.push_back(start);
    while (!stack.empty()) {
      const uint32_t t = stack.back();
      stack.pop_back();
      for (uint32_t next : mesh.neighbours[t]) {
        if (next == MeshTopology::kNone || (*label)[next] != kPending) continue;
        (*label)[next] = count;
        stack.push_back(next);
      }
    }
    ++count;
  }
  std::vector<std::vector<uint32_t>> components(count);
  for (uint32_t t : triangles) components[(*label)[t]].push_back(t);
  for (uint32_t t : triangles) (*label)[t] = MeshTopology::kNone;
  return components;
}

double triangle_area(const Object& object, const Triangle& triangle) {
  return 0.5 * shape_of(object, triangle).twice_area;
}

}  // namespace lightloom
