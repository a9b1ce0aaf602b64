// lights.json: named sets of lights that replace those of a level.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "core/base/status.h"
#include "core/scene/scene.h"

namespace lightloom {

struct Rig {
  std::string name;
  std::vector<Light> lights;
  std::map<std::string, Vec3> emission;  ///< material name → emitted radiance, replaces the material's
  std::optional<Vec3> environment;       ///< sky radiance, replaces the scene's
};

/// Format: {"rigs": [{"name", "lights": [{"type", "position", "direction", "color", "intensity", "innerConeAngle",
/// "outerConeAngle"}], "emissive": {"material": [r,g,b]}, "environment": [r,g,b]}]}, world space, glTF axes.
absl::StatusOr<std::vector<Rig>> load_rigs(const std::filesystem::path& path);
absl::StatusOr<Rig> find_rig(const std::vector<Rig>& rigs, const std::string& name);

/// Replaces the scene's lights, and its emission and environment where the rig says so. Fails if the rig names a
/// material that the scene lacks.
absl::Status apply_rig(const Rig& rig, Scene* scene);

}  // namespace lightloom
