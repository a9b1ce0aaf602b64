// What several commands do first: load a level, put a rig of lights in it, and lay out its lightmap.
#pragma once

#include <functional>
#include <memory>
#include <string>

#include "core/base/status.h"
#include "core/receivers/layout.h"
#include "core/scene/ray_tracer.h"
#include "core/scene/scene.h"

namespace lightloom {

/// The scene and its ray tracer, which points into it.
struct Level {
  std::unique_ptr<Scene> scene;
  std::unique_ptr<RayTracer> tracer;
};

/// Before any work: the files are there, and the names can go together.
absl::Status check_level(const std::string& path, const std::string& lights, const std::string& rig);

/// `lights` empty: the lights of the glTF. `edit` changes the scene before the ray tracer sees it. Warnings of the scene
/// go to stderr. Stops between its steps when interrupted.
absl::StatusOr<Level> load_level(const std::string& path, const std::string& lights = "", const std::string& rig = "",
                                 const std::function<absl::Status(Scene*)>& edit = nullptr);

/// The scene's camera of that name, or its first one if the name is empty. `path` is the level's, for messages; a picture
/// of `width` pixels must not be too high.
absl::StatusOr<Camera> find_camera(const Scene& scene, const std::string& name, const std::string& path, int width);

}  // namespace lightloom
