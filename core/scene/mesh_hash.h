// The identity of a mesh: what must be baked anew when it changes, and nothing else.
#pragma once

#include <map>

#include "core/base/hash.h"
#include "core/scene/scene.h"

namespace lightloom {

/// Hashes the meshes of one scene; keeps the digests of the textures that mask them.
class MeshHasher {
 public:
  explicit MeshHasher(const Scene& scene) : scene_(scene) {}

  /// SHA-256 of positions, normals, uv1 and triangles, with per triangle the alpha mode, sidedness and, where
  /// masked, all that shapes the holes. Not of albedo, emission or names, nor of uv0 unless it shapes holes.
  /// `local`: its geometry is in the space of the node.
  Digest hash(const Object& local);

 private:
  Digest alpha_of(int texture);

  const Scene& scene_;
  std::map<int, Digest> alpha_;  // by texture
};

}  // namespace lightloom
