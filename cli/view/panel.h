// The panel beside the picture: cameras, lights, the picked object, overlays, saving and baking.
#pragma once

#include <vector>

#include "cli/view/live_level.h"
#include "cli/view/script.h"
#include "cli/view/state.h"

namespace lightloom::view {

/// Within a Ui's frame. What was clicked and dragged comes back as actions.
std::vector<Action> draw_panel(const LiveLevel& level, const State& state, const std::string& save_as);

/// Circles and names at the lights, in the picture.
void draw_lights(const LiveLevel& level, const Camera& camera);

}  // namespace lightloom::view
