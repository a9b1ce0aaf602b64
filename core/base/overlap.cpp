#include "core/base/overlap.h"

#include <algorithm>
#include <cmath>

namespace lightloom {

/// By separating axes (Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", JGT 6(1), 2001).
bool overlaps(Vec3 a, Vec3 b, Vec3 c, float h) {
  const auto separates = [&](Vec3 axis) {
    const float pa = dot(axis, a), pb = dot(axis, b), pc = dot(axis, c);
    const float reach = h * (std::abs(axis.x) + std::abs(axis.y) + std::abs(axis.z));
    return std::min({pa, pb, pc}) > reach || std::max({pa, pb, pc}) < -reach;
  };
  const Vec3 edges[3] = {b - a, c - b, a - c};
  if (separates(cross(edges[0], edges[1]))) return false;
  for (const Vec3 unit : {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}}) {
    if (separates(unit)) return false;
    for (const Vec3 edge : edges) {
      if (separates(cross(unit, edge))) return false;
    }
  }
  return true;
}

}  // namespace lightloom
