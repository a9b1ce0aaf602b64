#include "tests/support/test_scenes.h"

#include <cstdlib>
#include <utility>

#include "core/base/check.h"
#include "core/scene/mesh_hash.h"
#include "core/scene/shapes.h"

namespace lightloom::test {

uint32_t add_material(Scene* scene, std::string name, Vec3 albedo, Vec3 emission) {
  Material m;
  m.name = std::move(name);
  m.base_color = albedo;
  m.emission = emission;
  scene->materials.push_back(std::move(m));
  return static_cast<uint32_t>(scene->materials.size() - 1);
}

Object& add_wall_object(Scene* scene, std::string name, Vec3 a, Vec3 b, Vec3 c, Vec3 d, uint32_t material) {
  Object& object = scene->objects.emplace_back();
  object.name = std::move(name);
  add_quad(&object, a, b, c, d, material);
  object.uv1 = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  return object;
}

Object& add_solid_box(Scene* scene, std::string name, Vec3 lo, Vec3 hi, uint32_t material) {
  Object& object = scene->objects.emplace_back();
  object.name = std::move(name);
  add_box(&object, lo, hi, material);
  return object;
}

void add_point_light(Scene* scene, Vec3 position, float intensity) {
  Light light;
  light.position = position;
  light.intensity = intensity;
  scene->lights.push_back(light);
}

void identify(Scene* scene) {
  MeshHasher hasher(*scene);
  for (Object& object : scene->objects) object.mesh_hash = hasher.hash(object);
  assign_object_ids(scene);
}

uint32_t object_named(const Scene& scene, const std::string& name) {
  for (uint32_t i = 0; i < scene.objects.size(); ++i) {
    if (scene.objects[i].name == name) return i;
  }
  LL_CHECK(false);
}

Scene closed_box(Vec3 s, const std::array<Wall, 6>& walls) {
  Scene scene;
  const std::array<const char*, 6> names{"floor", "ceiling", "west", "east", "north", "south"};
  const std::array<std::array<Vec3, 4>, 6> corners{{
      {{{0, 0, 0}, {0, 0, s.z}, {s.x, 0, s.z}, {s.x, 0, 0}}},
      {{{0, s.y, 0}, {s.x, s.y, 0}, {s.x, s.y, s.z}, {0, s.y, s.z}}},
      {{{0, 0, 0}, {0, s.y, 0}, {0, s.y, s.z}, {0, 0, s.z}}},
      {{{s.x, 0, 0}, {s.x, 0, s.z}, {s.x, s.y, s.z}, {s.x, s.y, 0}}},
      {{{0, 0, 0}, {s.x, 0, 0}, {s.x, s.y, 0}, {0, s.y, 0}}},
      {{{0, 0, s.z}, {0, s.y, s.z}, {s.x, s.y, s.z}, {s.x, 0, s.z}}},
  }};
  for (size_t i = 0; i < 6; ++i) {
    const uint32_t material = add_material(&scene, names[i], walls[i].albedo, walls[i].emission);
    add_wall_object(&scene, names[i], corners[i][0], corners[i][1], corners[i][2], corners[i][3], material);
  }
  identify(&scene);
  return scene;
}

Scene furnace(float albedo, float emission) {
  std::array<Wall, 6> walls;
  walls.fill({{albedo, albedo, albedo}, {emission, emission, emission}});
  return closed_box({2, 2, 2}, walls);
}

Scene open_plane(float side, Vec3 sky) {
  Scene scene;
  scene.environment = sky;
  const float h = side / 2;
  add_wall_object(&scene, "plane", {-h, 0, -h}, {-h, 0, h}, {h, 0, h}, {h, 0, -h},
                  add_material(&scene, "plane", {0.5f, 0.5f, 0.5f}));
  identify(&scene);
  return scene;
}

Scene facing_plates(float gap, float emission) {
  Scene scene;
  const uint32_t black = add_material(&scene, "black", {});
  const uint32_t glowing = add_material(&scene, "glowing", {}, {emission, emission, emission});
  add_wall_object(&scene, "target", {0, 0, 0}, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}, black);
  add_wall_object(&scene, "source", {0, gap, 0}, {1, gap, 0}, {1, gap, 1}, {0, gap, 1}, glowing);
  identify(&scene);
  return scene;
}

Scene sealed_double_room(float wall_thickness) {
  Scene scene = closed_box({6, 3, 3});
  const float h = wall_thickness / 2;
  add_solid_box(&scene, "divider", {3 - h, 0, 0}, {3 + h, 3, 3}, add_material(&scene, "divider", {0.5f, 0.5f, 0.5f}));
  add_point_light(&scene, {1.5f, 2, 1.5f}, 10);
  identify(&scene);
  return scene;
}

Scene room_with_crate() {
  Scene scene = closed_box({4, 3, 4});
  const uint32_t material = add_material(&scene, "crate", {0.5f, 0.5f, 0.5f});
  scene.materials[material].double_sided = true;
  add_solid_box(&scene, "crate", {1, 0, 1}, {2.5f, 1, 2.5f}, material);
  identify(&scene);
  return scene;
}

std::filesystem::path scenes_folder() {
  if (const char* folder = std::getenv("LIGHTLOOM_SCENES")) return folder;
  return std::filesystem::path(LIGHTLOOM_SOURCE_DIR).parent_path() / "shared" / "scenes";
}

}  // namespace lightloom::test
