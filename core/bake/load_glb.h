// A level that arrives as bytes.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/status.h"
#include "core/scene/scene.h"

namespace lightloom {

/// The .glb may come from anywhere: nothing outside it is read. Errors: load_gltf's, which name it "level.glb".
absl::StatusOr<Scene> load_glb(std::span<const uint8_t> bytes);

}  // namespace lightloom
