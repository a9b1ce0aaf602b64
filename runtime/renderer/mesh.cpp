#include "runtime/renderer/mesh.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "runtime/renderer/shaders/frame.h"

namespace lightloom::renderer {
namespace {

std::array<int16_t, 4> snorm(Vec3 n) {
  const auto pack = [](float c) { return static_cast<int16_t>(std::lround(std::clamp(c, -1.0f, 1.0f) * 32767)); };
  return {pack(n.x), pack(n.y), pack(n.z), 0};
}

Vec2 corner_uv(const Object& object, int set, uint32_t vertex) {
  const std::vector<Vec2>& uv = set == 1 ? object.uv1 : object.uv0;
  return uv.empty() ? Vec2{2 * gpu::kNoUv, 0} : uv[vertex];
}

/// The three corners of triangle `i`.
std::array<Vertex, 3> corners_of(const Scene& scene, const AtlasLayout& layout, size_t o, size_t i) {
  const Object& object = scene.objects[o];
  const Triangle& t = object.triangles[i];
  const Material& material = scene.materials[t.material];
  const auto& corners = layout.uv[o].corners;
  const Vec2 origin{static_cast<float>(layout.placements[o].x), static_cast<float>(layout.placements[o].y)};
  const Vec3 p0 = object.positions[t.v[0]];
  const Vec3 geometric = normalize(cross(object.positions[t.v[1]] - p0, object.positions[t.v[2]] - p0));
  std::array<Vertex, 3> out;
  for (size_t c = 0; c < 3; ++c) {
    Vertex& v = out[c];
    v.position = object.positions[t.v[c]];
    v.normal = object.normals[t.v[c]];
    v.geometric = snorm(geometric);
    v.base_uv = corner_uv(object, material.base_color_uv, t.v[c]);
    v.emission_uv = corner_uv(object, material.emission_uv, t.v[c]);
    v.lightmap_uv = corners.empty() ? Vec2{-1, -1} : corners[i][c] + origin;
  }
  return out;
}

}  // namespace

Mesh make_mesh(const Scene& scene, const AtlasLayout& layout) {
  // Opaque materials first, each with its triangles together.
  std::vector<uint32_t> materials(scene.materials.size());
  std::iota(materials.begin(), materials.end(), 0u);
  const auto masked = [&](uint32_t m) { return scene.materials[m].alpha_mode == AlphaMode::kMask; };
  std::stable_partition(materials.begin(), materials.end(), [&](uint32_t m) { return !masked(m); });

  std::vector<uint32_t> count(materials.size());
  for (const Object& object : scene.objects) {
    if (!object.is_static) continue;
    for (const Triangle& t : object.triangles) count[t.material] += 3;
  }
  Mesh mesh;
  std::vector<uint32_t> next(materials.size());
  uint32_t total = 0;
  for (const uint32_t m : materials) {
    next[m] = total;
    if (count[m] > 0) mesh.ranges.push_back({m, total, count[m]});
    total += count[m];
    if (!masked(m)) mesh.opaque = total;
  }

  mesh.vertices.resize(total);
  for (size_t o = 0; o < scene.objects.size(); ++o) {
    const Object& object = scene.objects[o];
    if (!object.is_static) continue;
    for (size_t i = 0; i < object.triangles.size(); ++i) {
      const uint32_t material = object.triangles[i].material;
      mesh.first.try_emplace({static_cast<uint32_t>(o), material}, next[material]);
      for (const Vertex& v : corners_of(scene, layout, o, i)) mesh.vertices[next[material]++] = v;
    }
  }
  return mesh;
}

std::vector<VertexRun> object_vertices(const Scene& scene, const AtlasLayout& layout, const Mesh& mesh, size_t object) {
  std::map<uint32_t, VertexRun> runs;
  const std::vector<Triangle>& triangles = scene.objects[object].triangles;
  for (size_t i = 0; scene.objects[object].is_static && i < triangles.size(); ++i) {
    VertexRun& run = runs[triangles[i].material];
    run.first = mesh.first.at({static_cast<uint32_t>(object), triangles[i].material});
    for (const Vertex& v : corners_of(scene, layout, object, i)) run.vertices.push_back(v);
  }
  std::vector<VertexRun> out;
  out.reserve(runs.size());
  for (auto& [material, run] : runs) out.push_back(std::move(run));
  return out;
}

}  // namespace lightloom::renderer
