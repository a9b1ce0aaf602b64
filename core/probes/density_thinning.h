// An even subset of points: the densest go first.
#pragma once

#include <cstddef>
#include <vector>

#include "core/base/vec.h"

namespace lightloom {

/// Removes points one by one, each time that of greatest density Σ_j w(|p − p_j|/radius), until `count` are left
/// (SL17 Sec. 4.1, with its Eq. 10 as kernel). Equal densities: the earliest goes. Keeps the order.
std::vector<Vec3> thin_by_density(const std::vector<Vec3>& points, float radius, size_t count);

}  // namespace lightloom
