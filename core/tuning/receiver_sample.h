// A few receivers that stand for a level's.
#pragma once

#include <span>
#include <vector>

#include "core/bake/plan.h"

namespace lightloom {

/// Numbers of the front sides, ascending; of all receivers, if there are only backs.
std::vector<uint32_t> front_receivers(const Receivers& receivers);

/// `count` of them (all, if there are fewer): one at random of each of as many equal stretches, for neighbours have neighbouring
/// numbers.
std::vector<uint32_t> stratified(std::span<const uint32_t> receivers, size_t count, uint64_t seed);

/// A bake cell of one receiver: its task knows where rays start and which probes are in reach.
PlannedCell cell_of_one(uint32_t receiver);

}  // namespace lightloom
