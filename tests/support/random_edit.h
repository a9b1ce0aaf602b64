// What a level artist does to a level, drawn by lot.
#pragma once

#include <string>

#include "core/base/rng.h"
#include "core/scene/scene.h"

namespace lightloom::test {

struct Edit {
  std::string what;       ///< for messages
  bool geometry = false;  ///< it may change what must be baked
};

/// Moves, turns, scales, removes, adds or duplicates an object, opens a door, moves a vertex, changes a colour, an alpha
/// mask, sides, an emission or a light. At least one object stays. Identifies the scene anew.
Edit random_edit(Scene* scene, Rng* rng);

}  // namespace lightloom::test
