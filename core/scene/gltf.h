// glTF 2.0 in: .glb and .gltf files become a Scene.
#pragma once

#include <filesystem>

#include "core/base/status.h"
#include "core/scene/scene.h"

namespace lightloom {

/// Loads and validates a level. Every error is one line that names the file and the glTF element and says how to mend
/// it. Usable defects (zero-area triangles, missing normals, …) are mended and end in
/// Scene::warnings.
///
/// Node `extras` understood: "lightloom": {"static": bool, "texel_scale": number > 0, "receive":
/// "lightmap" | "volume" | "none"}.
absl::StatusOr<Scene> load_gltf(const std::filesystem::path& path);

/// Writes a self-contained .glb that load_gltf reads back to the same triangles, materials, lights and cameras:
/// objects keep name, transform, extras and one mesh each. Bit for bit where the transform is the identity; else the
/// geometry goes back to local space and is rounded there. Objects without triangles and the environment, which glTF has
/// no word for, are not written. The bytes depend on the scene alone. For make-scene and tests.
absl::Status save_gltf(const Scene& scene, const std::filesystem::path& path);

}  // namespace lightloom
