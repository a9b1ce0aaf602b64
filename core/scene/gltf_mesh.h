// One glTF mesh, placed in the world by its node, as an Object.
#pragma once

#include <cstdint>
#include <string>

#include "core/base/status.h"
#include "core/scene/gltf_accessor.h"
#include "core/scene/gltf_warnings.h"
#include "core/scene/mesh_hash.h"
#include "core/scene/scene.h"

namespace tinygltf {
class Model;
struct Primitive;
}  // namespace tinygltf

namespace lightloom {

/// Reads the meshes of one file. Keeps what instances share, and bounds what they may add up to.
class MeshReader {
 public:
  /// `scene` has its materials; one more is added when a primitive has none.
  MeshReader(const tinygltf::Model& model, Scene* scene, GltfWarnings* warnings)
      : model_(model), scene_(scene), warnings_(warnings), hasher_(*scene) {}

  /// Fills the geometry and mesh_hash of an object whose name and transform are set: all primitives merged,
  /// without triangles that have no area. May leave no triangles.
  absl::Status read(int mesh, Object* object);

 private:
  struct Local;
  absl::Status append_vertices(const tinygltf::Primitive& primitive, uint64_t count, const std::string& whose,
                               const std::string& object, Local* local);
  absl::Status append_primitive(int mesh, size_t primitive, const std::string& object, Local* local);
  uint32_t default_material();

  const tinygltf::Model& model_;
  Scene* scene_;
  GltfWarnings* warnings_;
  int default_material_ = -1;
  uint64_t vertices_ = 0, triangles_ = 0;
  MeshHasher hasher_;
};

}  // namespace lightloom
