// What the viewer is showing and doing, as the panel shows it and the mouse reads it.
#pragma once

#include <optional>
#include <set>
#include <string>

#include "cli/view/camera.h"
#include "cli/view/child_bake.h"
#include "core/scene/picture.h"

namespace lightloom::view {

struct State {
  FlyCamera camera;
  float speed = 2;  ///< metres a second
  std::optional<size_t> picked;
  Layer layer = Layer::kFull;
  float exposure = 1;
  std::set<std::string> overlays = {"lights", "panel"};  ///< of kOverlays
  std::string message;                                   ///< the newest news, or error
  double frame_ms = 0, runtime_ms = 0;                   ///< smoothed
  bool baking = false;
  BakeProgress progress;
};

}  // namespace lightloom::view
