#include "tests/support/random_edit.h"

#include <cmath>
#include <functional>
#include <vector>

#include "core/base/vec.h"
#include "tests/support/test_scenes.h"

namespace lightloom::test {
namespace {

/// In [lo, hi).
float between(Rng* rng, float lo, float hi) { return lo + (hi - lo) * rng->next_float(); }

Vec3 random_vector(Rng* rng, float reach) {
  const float x = between(rng, -reach, reach), y = between(rng, -reach, reach);
  return {x, y, between(rng, -reach, reach)};
}

Aabb bounds_of(const Object& object) {
  Aabb box;
  for (const Vec3 p : object.positions) box.extend(p);
  return box;
}

void move(Object* object, Vec3 by) {
  for (Vec3& p : object->positions) p += by;
}

/// About the vertical line through `at`.
void turn(Object* object, Vec3 at, float angle) {
  const float c = std::cos(angle), s = std::sin(angle);
  const auto turned = [&](Vec3 v) { return Vec3{c * v.x + s * v.z, v.y, c * v.z - s * v.x}; };
  for (Vec3& p : object->positions) p = at + turned(p - at);
  for (Vec3& n : object->normals) n = turned(n);
}

/// A material of the object's own, to be changed.
Material& own_material(Scene* scene, Object* object) {
  Material copy = scene->materials[object->triangles.front().material];
  const auto index = static_cast<uint32_t>(scene->materials.size());
  scene->materials.push_back(std::move(copy));
  for (Triangle& t : object->triangles) t.material = index;
  return scene->materials.back();
}

}  // namespace

Edit random_edit(Scene* scene, Rng* rng) {
  const Aabb level = scene->bounds();
  const size_t chosen = rng->next_below(static_cast<uint32_t>(scene->objects.size()));
  Object& object = scene->objects[chosen];
  const Aabb box = bounds_of(object);
  const std::string name = object.name;
  const std::vector<std::function<Edit()>> edits = {
      [&] {
        move(&object, random_vector(rng, 0.5f));
        return Edit{"move " + name, true};
      },
      [&] {
        turn(&object, box.center(), between(rng, -3, 3));
        return Edit{"turn " + name, true};
      },
      [&] {
        const float factor = between(rng, 0.7f, 1.3f);
        for (Vec3& p : object.positions) p = box.center() + (p - box.center()) * factor;
        return Edit{"scale " + name, true};
      },
      [&] {
        if (scene->objects.size() > 1) scene->objects.erase(scene->objects.begin() + static_cast<ptrdiff_t>(chosen));
        return Edit{"remove " + name, true};
      },
      [&] {
        const Vec3 size = level.size();
        Vec3 at = level.lo;
        for (int a = 0; a < 3; ++a) at[a] += size[a] * rng->next_float();
        const Vec3 half{between(rng, 0.05f, 0.4f), between(rng, 0.05f, 0.4f), between(rng, 0.05f, 0.4f)};
        const uint32_t material = object.triangles.front().material;
        add_solid_box(scene, "added box", at - half, at + half, material);
        return Edit{"add a box", true};
      },
      [&] {
        Object copy = object;
        move(&copy, random_vector(rng, 1));
        copy.name += " again";
        scene->objects.push_back(std::move(copy));
        return Edit{"duplicate " + name, true};
      },
      [&] {
        turn(&object, box.lo, between(rng, 0.2f, 1.5f));
        return Edit{"open " + name, true};
      },
      [&] {
        const uint32_t vertex = rng->next_below(static_cast<uint32_t>(object.positions.size()));
        object.positions[vertex] += random_vector(rng, 0.1f);
        return Edit{"move a vertex of " + name, true};
      },
      [&] {
        Material& material = own_material(scene, &object);
        material.alpha_mode = AlphaMode::kMask;
        material.alpha = 0.25f;
        return Edit{"mask out " + name, true};
      },
      [&] {
        Material& material = own_material(scene, &object);
        material.double_sided = !material.double_sided;
        return Edit{"sides of " + name, true};
      },
      [&] {
        own_material(scene, &object).base_color = {0.1f, 0.7f, rng->next_float()};
        return Edit{"albedo of " + name, false};
      },
      [&] {
        own_material(scene, &object).emission = {1, rng->next_float(), 2};
        return Edit{"emission of " + name, false};
      },
      [&] {
        add_point_light(scene, level.center() + random_vector(rng, 1), 3);
        return Edit{"another light", false};
      },
  };
  const Edit edit = edits[rng->next_below(static_cast<uint32_t>(edits.size()))]();
  identify(scene);
  return edit;
}

}  // namespace lightloom::test
