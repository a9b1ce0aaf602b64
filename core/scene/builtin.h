// Levels made by code, for `lightloom make-scene`, the demo and the tests.
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "core/base/status.h"
#include "core/scene/scene.h"

namespace lightloom {

/// cornell flat maze town gallery
const std::vector<std::string>& builtin_scene_names();
/// Deterministic; separate named objects, lights, a camera.
absl::StatusOr<Scene> builtin_scene(std::string_view name);

}  // namespace lightloom
