// Whether simple shapes meet.
#pragma once

#include "core/base/vec.h"

namespace lightloom {

/// A triangle and the cube of half side h around the origin. Touching counts.
bool overlaps(Vec3 a, Vec3 b, Vec3 c, float h);

/// Touching counts.
inline bool overlaps(const Aabb& a, const Aabb& b) {
  for (int i = 0; i < 3; ++i) {
    if (a.lo[i] > b.hi[i] || b.lo[i] > a.hi[i]) return false;
  }
  return true;
}

}  // namespace lightloom
