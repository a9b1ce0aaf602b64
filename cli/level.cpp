#include "cli/level.h"

#include <cstdio>

#include "core/scene/gltf.h"
#include "core/scene/rig.h"

namespace lightloom {

absl::StatusOr<Level> load_level(const std::string& path, const std::string& lights, const std::string& rig,
                                 const std::function<absl::Status(Scene*)>& edit) {
  LL_ASSIGN_OR_RETURN(Scene scene, load_gltf(path));
  for (const std::string& warning : scene.warnings) std::fprintf(stderr, "warning: %s\n", warning.c_str());
  if (lights.empty() && !rig.empty()) {
    return absl::InvalidArgumentError("--rig names a rig of --lights; give --lights FILE.json too");
  }
  if (!lights.empty()) {
    LL_ASSIGN_OR_RETURN(const auto rigs, load_rigs(lights));
    if (rig.empty() && rigs.size() != 1) {
      return absl::InvalidArgumentError(lights + " has several rigs; choose one with --rig NAME");
    }
    LL_ASSIGN_OR_RETURN(const Rig chosen, rig.empty() ? absl::StatusOr<Rig>(rigs.front()) : find_rig(rigs, rig));
    LL_RETURN_IF_ERROR(apply_rig(chosen, &scene));
  }
  if (edit) LL_RETURN_IF_ERROR(edit(&scene));
  Level level;
  level.scene = std::make_unique<Scene>(std::move(scene));
  LL_ASSIGN_OR_RETURN(level.tracer, RayTracer::create(*level.scene));
  return level;
}

absl::StatusOr<Camera> find_camera(const Scene& scene, const std::string& name) {
  for (const Camera& camera : scene.cameras) {
    if (name.empty() || camera.name == name) return camera;
  }
  std::string known;
  for (const Camera& camera : scene.cameras) known += (known.empty() ? "" : ", ") + camera.name;
  return absl::NotFoundError(name.empty() ? "the scene has no camera; add one or leave --camera out"
                                          : "the scene has no camera '" + name +
                                                "'; it has: " + (known.empty() ? "none" : known));
}

}  // namespace lightloom
