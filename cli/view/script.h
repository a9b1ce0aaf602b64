// What a viewer can be told to do, as text: one command a line. The panel's buttons are the same commands.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/status.h"
#include "core/base/vec.h"

namespace lightloom::view {

enum class Verb {
  kWait,         ///< N frames
  kWaitBake,     ///< until no bake runs
  kWaitReload,   ///< until someone else has baked the asset anew
  kWaitArrival,  ///< until all that the camera needs is in memory
  kCamera,       ///< x y z yaw pitch, degrees
  kCameraNamed,  ///< one of the level's
  kLight,        ///< NAME x y z
  kLightColour,  ///< NAME r g b
  kLightPower,   ///< NAME W/sr or W/m²
  kPick,         ///< OBJECT
  kClick,        ///< x y, in [0, 1] from the top left
  kAlbedo,       ///< r g b, of what is picked
  kEmission,     ///< r g b
  kMove,         ///< dx dy dz
  kDuplicate,
  kDelete,
  kSave,  ///< FILE.glb
  kRebake,
  kCancelBake,
  kReload,
  kOverlay,     ///< NAME on|off
  kLayer,       ///< full, direct, indirect, E, albedo
  kExposure,    ///< factor; 0: from the next frame
  kResize,      ///< pixels
  kScreenshot,  ///< FILE.png
  kQuit,
};

struct Action {
  Verb verb = Verb::kWait;
  std::string name = "";  ///< of a light, object, camera, overlay, layer or file
  std::vector<float> numbers = {};
  bool on = false;  ///< kOverlay
  int index = -1;   ///< by hand: of the light or camera, whose name need not be its own; -1: by name
  int line = 0;     ///< of the script; 0: not from one

  Vec3 vec3() const { return {numbers[0], numbers[1], numbers[2]}; }
};

inline constexpr const char* kOverlays[] = {"cells", "ranks", "probes", "stale", "residency", "lights", "panel"};
inline constexpr const char* kLayers[] = {"full", "direct", "indirect", "E", "albedo"};

/// Words are apart by blanks; "a name" with blanks stands in quotes; # begins a comment. Errors say "line N: …".
absl::StatusOr<std::vector<Action>> parse_script(std::string_view text);

}  // namespace lightloom::view
