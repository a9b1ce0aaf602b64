// What is wrong with a level's triangles that a bake survives, but an artist may want to mend.
#pragma once

#include <cstdint>
#include <string>

#include "core/scene/scene.h"

namespace lightloom {

struct Defects {
  uint64_t duplicates = 0;   ///< triangles whose three corners are those of an earlier one
  uint64_t flipped = 0;      ///< edges whose two triangles face opposite ways
  uint64_t t_junctions = 0;  ///< open edges on which the corner of another triangle lies
  uint64_t cracks = 0;       ///< open edges that another part of the border comes near and misses
  bool operator==(const Defects&) const = default;
};

/// Near: within 2 cm, and within a twentieth of the edge. Corners are the same where their positions are exactly equal.
/// An edge that only one triangle has is open. Looks at static objects, all together.
Defects find_defects(const Scene& scene);

/// "2 duplicate triangles, 3 T-junctions"; empty if there are none.
std::string describe(const Defects& defects);

}  // namespace lightloom
