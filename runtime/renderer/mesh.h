// A level's static triangles as the renderer draws them: one vertex buffer, one range per material.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "core/receivers/layout.h"
#include "core/scene/scene.h"

namespace lightloom::renderer {

/// Not shared between triangles: each has its own geometric normal and place in the lightmap.
struct Vertex {
  Vec3 position, normal;
  std::array<int16_t, 4> geometric;  ///< snorm; unit, by winding
  Vec2 base_uv, emission_uv;
  Vec2 lightmap_uv;  ///< texels of the lightmap image; -1: the object has no lightmap
};
static_assert(sizeof(Vertex) == 56);

struct DrawRange {
  uint32_t material = 0;
  uint32_t first = 0, count = 0;  ///< vertices
};

struct Mesh {
  std::vector<Vertex> vertices;
  std::vector<DrawRange> ranges;  ///< opaque materials first
  uint32_t opaque = 0;            ///< vertices of opaque materials
  /// Where each object's vertices of a material begin: by (object, material), for those that have some.
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> first;
};

Mesh make_mesh(const Scene& scene, const AtlasLayout& layout);

/// An object's vertices of one material, as the object is now, and where they lie in the mesh.
struct VertexRun {
  uint64_t first = 0;
  std::vector<Vertex> vertices;
};
std::vector<VertexRun> object_vertices(const Scene& scene, const AtlasLayout& layout, const Mesh& mesh, size_t object);

}  // namespace lightloom::renderer
