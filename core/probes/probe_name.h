// What a probe is called: the same in every plan that has it.
#pragma once

#include <cstdint>

#include "core/base/vec.h"

namespace lightloom {

struct ProbeName {
  GridCell cell{};    ///< world cell of side `spacing`
  uint32_t slot = 0;  ///< numbers the probes of a cell
  auto operator<=>(const ProbeName&) const = default;
};
static_assert(sizeof(ProbeName) == 16);

}  // namespace lightloom
