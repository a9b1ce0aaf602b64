// Parametric solids for levels made by code. Every shape is closed, its faces look outwards, and it has no
// T-junctions. Only IEEE operations and square roots: the same bits everywhere.
#pragma once

#include <vector>

#include "core/base/vec.h"
#include "core/scene/scene.h"

namespace lightloom {

/// Appends a flat quad; a, b, c, d counter-clockwise seen from the front.
void add_quad(Object* object, Vec3 a, Vec3 b, Vec3 c, Vec3 d, uint32_t material);
void add_triangle(Object* object, Vec3 a, Vec3 b, Vec3 c, uint32_t material);

void add_box(Object* object, Vec3 lo, Vec3 hi, uint32_t material);

/// A rectangular hole through a wall: its extent along the wall and in height, in world coordinates. A
/// `bottom` at or below the wall's makes it a doorway.
struct Opening {
  float from = 0, to = 0, bottom = 0, top = 0;
};
/// An upright box with rectangular holes. `thin_axis`: 0 (x) or 2 (z), the direction of its thickness.
/// `negative` and `positive` are the materials of its two sides; edges and reveals take `positive`.
void add_wall(Object* object, Vec3 lo, Vec3 hi, int thin_axis, const std::vector<Opening>& openings, uint32_t negative,
              uint32_t positive);

/// Points (cos, sin) of `n` equal angles, by bisection. REQUIRES: n is a power of two, at least 4.
std::vector<Vec2> circle(int n);

/// A surface of revolution around an axis through `center`. `profile`: (radius, height) from the bottom to
/// the top of the axis; from radius 0 to radius 0, or a loop if `loop`. A point given twice makes a crease.
/// `flutes` grooves of relative depth `flute_depth` where the profile's third value, `fluted`, says so.
struct Lathe {
  Vec3 center;
  int axis = 1;  ///< 0, 1, 2: x, y, z
  struct Point {
    float radius = 0, height = 0;
    bool fluted = false;
  };
  std::vector<Point> profile;
  bool loop = false;
  int segments = 64;  ///< power of two
  int flutes = 0;     ///< divides segments
  float flute_depth = 0;
};
void add_lathe(Object* object, const Lathe& lathe, uint32_t material);

void add_sphere(Object* object, Vec3 center, float radius, int segments, uint32_t material);
/// `axis`: 0, 1, 2: the ring's axis. `radius`: to the middle of the tube.
void add_torus(Object* object, Vec3 center, int axis, float radius, float tube, int segments, uint32_t material);

/// Cuts each triangle into four at the middles of its edges: the same surface.
void subdivide(Object* object);

}  // namespace lightloom
