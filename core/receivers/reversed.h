// Surfaces that face the wrong way: a wall modelled inside out blocks light in its room, and shines at nobody.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/parallel.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// Static objects of single-sided materials that look reversed: from behind them more is seen of the fronts of other objects
/// (by half, and with an eighth of the rays at least) than from in front. Indices, ascending. Judged by 16 points of an
/// object; those sunk in other solids have no say. Sheets between
/// two rooms, and what has two sides, are none.
std::vector<uint32_t> reversed_objects(const RayTracer& tracer, const Parallel& parallel);

}  // namespace lightloom
