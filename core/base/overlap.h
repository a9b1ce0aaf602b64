// Whether simple shapes meet.
#pragma once

#include "core/base/vec.h"

namespace lightloom {

/// A triangle and the cube of half side h around the origin. Touching counts.
bool overlaps(Vec3 a, Vec3 b, Vec3 c, float h);

}  // namespace lightloom
