// Directions as points of a square (Cigolle et al., "A Survey of Efficient Representations for Independent Unit Vectors",
// JCGT 3(2), 2014).
#pragma once

#include <cmath>

#include "core/base/vec.h"

namespace lightloom {

/// The lower half of the octahedron, folded out around the upper one; and back.
inline Vec2 octahedral_fold(Vec2 p) {
  return {(1 - std::abs(p.y)) * std::copysign(1.0f, p.x), (1 - std::abs(p.x)) * std::copysign(1.0f, p.y)};
}

/// Of a direction of any length but 0, in [−1, 1]².
inline Vec2 octahedral(Vec3 d) {
  const float sum = std::abs(d.x) + std::abs(d.y) + std::abs(d.z);
  const Vec2 p{d.x / sum, d.y / sum};
  return d.z < 0 ? octahedral_fold(p) : p;
}

/// The inverse, on the octahedron |x| + |y| + |z| = 1.
inline Vec3 from_octahedral(Vec2 p) {
  const float z = 1 - std::abs(p.x) - std::abs(p.y);
  if (z < 0) p = octahedral_fold(p);
  return {p.x, p.y, z};
}

}  // namespace lightloom
