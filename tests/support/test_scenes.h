// Small levels made by code, and where the big ones lie. Metres; y is up; all materials are single-sided.
//
// Every flat wall is an object of its own whose TEXCOORD_1 fills [0,1]²: a layout with a round number of
// texels per metre puts it on whole texels.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>

#include "core/scene/scene.h"

namespace lightloom::test {

/// Appends a material; returns its index.
uint32_t add_material(Scene* scene, std::string name, Vec3 albedo, Vec3 emission = {});

/// Appends an object of one quad a, b, c, d, counter-clockwise seen from the front; u runs along ab, v along
/// ad. The reference lives until the next object.
Object& add_wall_object(Scene* scene, std::string name, Vec3 a, Vec3 b, Vec3 c, Vec3 d, uint32_t material);

/// Appends a closed box that looks outwards, without TEXCOORD_1.
Object& add_solid_box(Scene* scene, std::string name, Vec3 lo, Vec3 hi, uint32_t material);

void add_point_light(Scene* scene, Vec3 position, float intensity);

/// Mesh hashes and object ids, as after loading: call it when the geometry is complete.
void identify(Scene* scene);

/// The index of an object by name. Aborts if there is none.
uint32_t object_named(const Scene& scene, const std::string& name);

struct Wall {
  Vec3 albedo{0.5f, 0.5f, 0.5f};
  Vec3 emission;
};
/// The inside of the box from the origin to `size`. Walls and their objects: "floor", "ceiling", "west" (x =
/// 0), "east", "north" (z = 0), "south"; materials carry the same names.
Scene closed_box(Vec3 size, const std::array<Wall, 6>& walls = {});

/// A 2 m cube whose walls all emit radiance `emission` and have the given albedo: E = π·emission ÷ (1 −
/// albedo).
Scene furnace(float albedo, float emission);

/// One square, "plane", centred at the origin and facing up, under a sky of constant radiance.
Scene open_plane(float side, Vec3 sky);

/// Unit squares face to face, "target" at y = 0 below "source" at y = gap. The source emits `emission`; both
/// are black.
Scene facing_plates(float gap, float emission);

/// Two 3 m cubes apart by a solid wall centred at x = 3; a point light in the western one (x < 3).
Scene sealed_double_room(float wall_thickness);

/// A closed 4 m × 3 m × 4 m room; in it "crate", a solid box on the floor over x, z in [1, 2.5], 1 m high,
/// double-sided.
Scene room_with_crate();

/// The folder of the big test scenes: LIGHTLOOM_SCENES, else ../shared/scenes beside the sources. May not
/// exist.
std::filesystem::path scenes_folder();

}  // namespace lightloom::test
