// Mouse and keys over the picture: flying, picking, dragging lights and objects.
#pragma once

#include <optional>
#include <vector>

#include "cli/view/live_level.h"
#include "cli/view/script.h"
#include "cli/view/state.h"
#include "cli/view/window.h"

namespace lightloom::view {

class Input {
 public:
  /// Once a frame, within a Ui's frame. Moves the camera itself; what else is meant comes back as actions.
  absl::StatusOr<std::vector<Action>> read(const Events& events, LiveLevel* level, State* state, float aspect);
  /// Whether a hand was on mouse or keys in the last frame.
  bool busy() const { return busy_; }

 private:
  void fly(State* state);
  absl::Status press(LiveLevel* level, const State& state, const Camera& camera, Vec2 at);
  void drag(const LiveLevel& level, const Camera& camera, Vec2 from, Vec2 to, State* state,
            std::vector<Action>* actions);

  enum class Grip { kNothing, kView, kLight, kObject };
  Grip grip_ = Grip::kNothing;  ///< what the left button holds
  size_t light_ = 0, object_ = 0;
  Vec2 pressed_, last_;  ///< where, and where the mouse was in the last frame
  bool moved_ = false;   ///< since it was pressed: no click
  bool busy_ = false;
};

}  // namespace lightloom::view
