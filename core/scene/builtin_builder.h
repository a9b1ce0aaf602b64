// What the built-in levels are written with.
#pragma once

#include <string>
#include <utility>

#include "core/base/vec.h"
#include "core/scene/mesh_hash.h"
#include "core/scene/scene.h"

namespace lightloom {

class SceneBuilder {
 public:
  /// A single-sided, opaque material.
  uint32_t material(std::string name, Vec3 base_color) {
    Material m;
    m.name = std::move(name);
    m.base_color = base_color;
    scene_.materials.push_back(std::move(m));
    return static_cast<uint32_t>(scene_.materials.size() - 1);
  }

  /// A new, empty object with an identity transform. Valid until the next call.
  Object* object(std::string name) {
    scene_.objects.emplace_back().name = std::move(name);
    return &scene_.objects.back();
  }

  void light(Light light) { scene_.lights.push_back(std::move(light)); }

  void point_light(std::string name, Vec3 position, Vec3 color, float intensity) {
    Light l;
    l.name = std::move(name);
    l.position = position;
    l.color = color;
    l.intensity = intensity;
    scene_.lights.push_back(std::move(l));
  }

  /// Upright, looking at `target`.
  void camera(std::string name, Vec3 position, Vec3 target, float yfov, float aspect) {
    Camera c;
    c.name = std::move(name);
    c.position = position;
    c.forward = normalize(target - position);
    c.right = normalize(cross(c.forward, {0, 1, 0}));
    c.up = cross(c.right, c.forward);
    c.yfov = yfov;
    c.aspect = aspect;
    scene_.cameras.push_back(std::move(c));
  }

  Scene finish() {
    MeshHasher hasher(scene_);
    for (Object& o : scene_.objects) o.mesh_hash = hasher.hash(o);
    assign_object_ids(&scene_);
    return std::move(scene_);
  }

 private:
  Scene scene_;
};

Scene make_cornell();
Scene make_flat();
Scene make_maze();
Scene make_town();
Scene make_gallery();

}  // namespace lightloom
