#include "core/scene/gltf_mesh.h"

#include <tiny_gltf.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <map>
#include <string>
#include <utility>

#include "core/scene/affine.h"

namespace lightloom {

/// Geometry in the node's space. Normals are zero where the file has no usable one.
struct MeshReader::Local : Object {
  bool has_uv0 = false, has_uv1 = false, lacks_uv1 = false;
  std::map<std::map<std::string, int>, uint32_t> bases;  // attributes → first vertex, for primitives that share them
};

namespace {

constexpr uint64_t kMaxTriangles = uint64_t{1} << 25;
constexpr double kFarthest = 1e9;  // metres; beyond it float has no use

absl::Status invalid(std::string message) { return absl::InvalidArgumentError(std::move(message)); }

/// Values of an optional attribute, one per vertex, or empty if the primitive has none.
absl::StatusOr<std::vector<float>> attribute(const tinygltf::Model& model, const tinygltf::Primitive& primitive,
                                             const char* name, int components, uint64_t vertices,
                                             const std::string& whose) {
  const auto it = primitive.attributes.find(name);
  if (it == primitive.attributes.end()) return std::vector<float>{};
  LL_ASSIGN_OR_RETURN(const uint64_t count, accessor_count(model, it->second));
  if (count != vertices) {
    return invalid(whose + ": " + name + " has " + std::to_string(count) + " elements where POSITION has " +
                   std::to_string(vertices) + "; export the file again");
  }
  return read_floats(model, it->second, components);
}

/// Corner triples of a primitive's triangles (glTF 2.0, 3.7.2.1).
absl::StatusOr<std::vector<std::array<uint32_t, 3>>> corners(const std::vector<uint32_t>& i, int mode,
                                                             const std::string& whose) {
  std::vector<std::array<uint32_t, 3>> out;
  if (mode == TINYGLTF_MODE_TRIANGLES) {
    if (i.size() % 3 != 0) {
      return invalid(whose + ": " + std::to_string(i.size()) +
                     " corners are not a multiple of 3; export the file again");
    }
    for (size_t k = 0; k + 2 < i.size(); k += 3) out.push_back({i[k], i[k + 1], i[k + 2]});
    return out;
  }
  for (size_t k = 0; k + 2 < i.size(); ++k) {
    const std::array<uint32_t, 3> c = mode == TINYGLTF_MODE_TRIANGLE_FAN
                                          ? std::array<uint32_t, 3>{i[k + 1], i[k + 2], i[0]}
                                          : std::array<uint32_t, 3>{i[k], i[k + 1 + k % 2], i[k + 2 - k % 2]};
    // Strips repeat corners on purpose, to turn.
    if (c[0] != c[1] && c[1] != c[2] && c[2] != c[0]) out.push_back(c);
  }
  return out;
}

/// Appends values of `width` floats each as vectors; zeros where there are none. Returns how many were not
/// finite.
template <class Vec>
uint64_t append(const std::vector<float>& values, uint64_t count, std::vector<Vec>* out) {
  constexpr size_t kWidth = sizeof(Vec) / sizeof(float);
  uint64_t bad = 0;
  for (uint64_t i = 0; i < count; ++i) {
    Vec v{};
    if (!values.empty()) {
      const float* p = &values[i * kWidth];
      bool finite = true;
      for (size_t c = 0; c < kWidth; ++c) finite = finite && std::isfinite(p[c]);
      if (finite) {
        v.x = p[0];
        v.y = p[1];
        if constexpr (kWidth == 3) v.z = p[2];
      } else {
        ++bad;
      }
    }
    out->push_back(v);
  }
  return bad;
}

bool usable(Vec3 p) {
  return is_finite(p) && std::abs(p.x) <= kFarthest && std::abs(p.y) <= kFarthest && std::abs(p.z) <= kFarthest;
}

bool has_area(const std::array<Vec3, 3>& p) {
  // In double, where the products of float differences are all but exact.
  const auto edge = [&](size_t i) {
    return Dvec3{double{p[i].x} - p[0].x, double{p[i].y} - p[0].y, double{p[i].z} - p[0].z};
  };
  const Dvec3 a = edge(1), b = edge(2);
  const double x = a[1] * b[2] - a[2] * b[1], y = a[2] * b[0] - a[0] * b[2], z = a[0] * b[1] - a[1] * b[0];
  // Below this, the normal cannot be computed in float.
  return std::sqrt(x * x + y * y + z * z) > 1e-18;
}

template <class T>
void keep(const std::vector<uint32_t>& kept, std::vector<T>* values) {
  if (values->empty()) return;
  std::vector<T> out;
  out.reserve(kept.size());
  for (const uint32_t i : kept) out.push_back((*values)[i]);
  *values = std::move(out);
}

/// The face normal of a triangle without defects.
Vec3 face_normal(const std::vector<Vec3>& positions, const Triangle& t) {
  const Vec3 p = positions[t.v[0]], a = positions[t.v[1]], b = positions[t.v[2]];
  const Dvec3 e{double{a.x} - p.x, double{a.y} - p.y, double{a.z} - p.z};
  const Dvec3 f{double{b.x} - p.x, double{b.y} - p.y, double{b.z} - p.z};
  return unit({e[1] * f[2] - e[2] * f[1], e[2] * f[0] - e[0] * f[2], e[0] * f[1] - e[1] * f[0]});
}

}  // namespace

uint32_t MeshReader::default_material() {
  if (default_material_ < 0) {
    default_material_ = static_cast<int>(scene_->materials.size());
    scene_->materials.emplace_back().name = "default";
  }
  return static_cast<uint32_t>(default_material_);
}

absl::Status MeshReader::append_vertices(const tinygltf::Primitive& primitive, uint64_t count, const std::string& whose,
                                         const std::string& object, Local* local) {
  LL_ASSIGN_OR_RETURN(const std::vector<float> p, attribute(model_, primitive, "POSITION", 3, count, whose));
  LL_ASSIGN_OR_RETURN(const std::vector<float> n, attribute(model_, primitive, "NORMAL", 3, count, whose));
  LL_ASSIGN_OR_RETURN(const std::vector<float> uv0, attribute(model_, primitive, "TEXCOORD_0", 2, count, whose));
  LL_ASSIGN_OR_RETURN(const std::vector<float> uv1, attribute(model_, primitive, "TEXCOORD_1", 2, count, whose));
  const auto base = static_cast<std::ptrdiff_t>(local->positions.size());
  for (uint64_t i = 0; i < count; ++i) local->positions.push_back({p[3 * i], p[3 * i + 1], p[3 * i + 2]});
  append(n, count, &local->normals);
  const uint64_t bad_uv = append(uv0, count, &local->uv0) + append(uv1, count, &local->uv1);
  if (bad_uv > 0) warnings_->add("texture coordinates were not finite and became 0", object, bad_uv);
  local->has_uv0 |= !uv0.empty();
  local->has_uv1 |= !uv1.empty();
  local->lacks_uv1 |= uv1.empty();
  if (n.empty()) {
    warnings_->add("primitives had no normals and got flat ones", object);
    return absl::OkStatus();
  }
  const auto bad = static_cast<uint64_t>(std::count(local->normals.begin() + base, local->normals.end(), Vec3{}));
  if (bad > 0) warnings_->add("normals were zero or not finite and became those of a face", object, bad);
  return absl::OkStatus();
}

absl::Status MeshReader::append_primitive(int mesh, size_t index, const std::string& object, Local* local) {
  const tinygltf::Primitive& primitive = model_.meshes[static_cast<size_t>(mesh)].primitives[index];
  const std::string whose = "mesh " + std::to_string(mesh) + " " +
                            shown(model_.meshes[static_cast<size_t>(mesh)].name) + " primitive " +
                            std::to_string(index);
  if (primitive.mode < TINYGLTF_MODE_TRIANGLES || primitive.mode > TINYGLTF_MODE_TRIANGLE_FAN) {
    warnings_->add("primitives of points or lines were left out", object);
    return absl::OkStatus();
  }
  const auto position = primitive.attributes.find("POSITION");
  if (position == primitive.attributes.end()) {
    warnings_->add("primitives without POSITION were left out", object);
    return absl::OkStatus();
  }
  if (primitive.material >= 0 && static_cast<size_t>(primitive.material) >= model_.materials.size()) {
    return invalid(whose + " uses material " + std::to_string(primitive.material) + ", which does not exist");
  }
  if (!primitive.targets.empty()) warnings_->add("primitives had morph targets, which were ignored", object);

  // The level's size is bounded before anything of it is read.
  LL_ASSIGN_OR_RETURN(const uint64_t vertices, accessor_count(model_, position->second));
  uint64_t corner_count = vertices;
  if (primitive.indices >= 0) {
    LL_ASSIGN_OR_RETURN(corner_count, accessor_count(model_, primitive.indices));
  }
  const bool has_normals = primitive.attributes.count("NORMAL") > 0;
  vertices_ += vertices + (has_normals ? 0 : 3 * corner_count);
  triangles_ += primitive.mode == TINYGLTF_MODE_TRIANGLES ? corner_count / 3 : corner_count;
  if (vertices_ > kMaxElements || triangles_ > kMaxTriangles) {
    return absl::ResourceExhaustedError(whose + ": the level has more than " + std::to_string(kMaxTriangles) +
                                        " triangles or " + std::to_string(kMaxElements) + " vertices; split it");
  }

  std::vector<uint32_t> indices;
  if (primitive.indices >= 0) {
    LL_ASSIGN_OR_RETURN(indices, read_indices(model_, primitive.indices));
  } else {
    for (uint32_t i = 0; i < vertices; ++i) indices.push_back(i);
  }
  for (const uint32_t i : indices) {
    if (i < vertices) continue;
    return invalid(whose + ": index " + std::to_string(i) + " is out of range, it has " + std::to_string(vertices) +
                   " vertices; export the file again");
  }
  LL_ASSIGN_OR_RETURN(auto triples, corners(indices, primitive.mode, whose));
  if (triples.empty()) return absl::OkStatus();

  const auto [shared, is_new] =
      local->bases.emplace(primitive.attributes, static_cast<uint32_t>(local->positions.size()));
  const uint32_t base = shared->second;
  if (is_new) LL_RETURN_IF_ERROR(append_vertices(primitive, vertices, whose, object, local));

  const uint32_t material = primitive.material >= 0 ? static_cast<uint32_t>(primitive.material) : default_material();
  const auto duplicate = [&](uint32_t v) {  // a corner of its own, so that its normal can be the face's
    local->positions.push_back(local->positions[v]);
    local->normals.push_back({});
    local->uv0.push_back(local->uv0[v]);
    local->uv1.push_back(local->uv1[v]);
    return static_cast<uint32_t>(local->positions.size() - 1);
  };
  for (const auto& c : triples) {
    Triangle t;
    t.material = material;
    for (size_t k = 0; k < 3; ++k) t.v[k] = has_normals ? base + c[k] : duplicate(base + c[k]);
    local->triangles.push_back(t);
  }
  return absl::OkStatus();
}

absl::Status MeshReader::read(int mesh, Object* object) {
  if (mesh < 0 || static_cast<size_t>(mesh) >= model_.meshes.size()) {
    return invalid("node " + shown(object->name) + " uses mesh " + std::to_string(mesh) + ", which does not exist");
  }
  Local local;
  for (size_t i = 0; i < model_.meshes[static_cast<size_t>(mesh)].primitives.size(); ++i) {
    LL_RETURN_IF_ERROR(append_primitive(mesh, i, object->name, &local));
  }
  if (!local.has_uv0) local.uv0.clear();
  if (!local.has_uv1 || local.lacks_uv1) local.uv1.clear();
  if (local.has_uv1 && local.lacks_uv1) {
    warnings_->add("objects had TEXCOORD_1 on some primitives only, which was dropped", object->name);
  }

  // Leave out what cannot be hit, as judged where rays will meet it: in world space, in float.
  std::vector<Vec3> world;
  world.reserve(local.positions.size());
  for (const Vec3 p : local.positions) {
    const Dvec3 w = transform_point(object->transform, {p.x, p.y, p.z});
    world.push_back({static_cast<float>(w[0]), static_cast<float>(w[1]), static_cast<float>(w[2])});
  }
  for (const Triangle& t : local.triangles) {
    if (usable(world[t.v[0]]) && usable(world[t.v[1]]) && usable(world[t.v[2]])) continue;
    return invalid(
        "mesh " + std::to_string(mesh) + " of object " + shown(object->name) +
        ": a triangle has a corner that is not a number, or over 1e9 m away; mend the mesh and export it again");
  }
  const uint64_t no_area = std::erase_if(local.triangles, [&](const Triangle& t) {
    return !has_area({world[t.v[0]], world[t.v[1]], world[t.v[2]]});
  });
  if (no_area > 0) warnings_->add("triangles without area were left out", object->name, no_area);

  // Vertices that no triangle uses go.
  std::vector<uint32_t> index(local.positions.size(), 0), kept;
  for (const Triangle& t : local.triangles) {
    for (const uint32_t v : t.v) index[v] = 1;
  }
  for (uint32_t v = 0; v < index.size(); ++v) {
    if (!index[v]) continue;
    index[v] = static_cast<uint32_t>(kept.size());
    kept.push_back(v);
  }
  for (Triangle& t : local.triangles) {
    for (uint32_t& v : t.v) v = index[v];
  }
  keep(kept, &world);
  keep(kept, &local.positions);
  keep(kept, &local.normals);
  keep(kept, &local.uv0);
  keep(kept, &local.uv1);
  object->mesh_hash = hasher_.hash(local);

  // To the world. A mirror turns triangles over, so their corners are turned back.
  const std::array<double, 9> c = cofactors(object->transform);
  const bool mirrored = determinant(object->transform) < 0;
  const double sign = mirrored ? -1 : 1;
  object->normals.reserve(local.normals.size());
  for (const Vec3 n : local.normals) {
    Dvec3 turned{};
    for (size_t row = 0; row < 3; ++row) {
      turned[row] = sign * (c[row] * n.x + c[3 + row] * n.y + c[6 + row] * n.z);
    }
    object->normals.push_back(unit(turned));
  }
  object->positions = std::move(world);
  object->triangles = std::move(local.triangles);
  for (Triangle& t : object->triangles) {
    if (mirrored) std::swap(t.v[1], t.v[2]);
    for (const uint32_t v : t.v) {
      if (object->normals[v] == Vec3{}) object->normals[v] = face_normal(object->positions, t);
    }
  }
  object->uv0 = std::move(local.uv0);
  object->uv1 = std::move(local.uv1);
  return absl::OkStatus();
}

}  // namespace lightloom
