// Objects for the tests of receivers. Triangles share no vertex indices: adjacency has to come from
// positions.
#pragma once

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "core/scene/scene.h"

namespace lightloom::shapes {

inline void add_triangle(Object* object, Vec3 a, Vec3 b, Vec3 c) {
  const uint32_t n = static_cast<uint32_t>(object->positions.size());
  object->positions.insert(object->positions.end(), {a, b, c});
  Triangle t;
  t.v = {n, n + 1, n + 2};
  object->triangles.push_back(t);
}

inline void add_quad(Object* object, Vec3 a, Vec3 b, Vec3 c, Vec3 d) {
  add_triangle(object, a, b, c);
  add_triangle(object, a, c, d);
}

/// Walls outwards over a polygon in x and z, counter-clockwise seen from above.
inline void add_walls(Object* object, const std::vector<Vec2>& outline, float y0, float y1) {
  for (size_t i = 0; i < outline.size(); ++i) {
    const Vec2 p = outline[i], q = outline[(i + 1) % outline.size()];
    add_quad(object, {p.x, y0, p.y}, {p.x, y1, p.y}, {q.x, y1, q.y}, {q.x, y0, q.y});
  }
}

/// Horizontal rectangle, facing up or down.
inline void add_slab(Object* object, Vec2 lo, Vec2 hi, float y, bool up) {
  const Vec3 a{lo.x, y, lo.y}, b{lo.x, y, hi.y}, c{hi.x, y, hi.y}, d{hi.x, y, lo.y};
  up ? add_quad(object, a, b, c, d) : add_quad(object, a, d, c, b);
}

inline Object box(Vec3 lo, Vec3 hi) {
  Object o;
  o.name = "box";
  add_walls(&o, {{lo.x, lo.z}, {hi.x, lo.z}, {hi.x, hi.z}, {lo.x, hi.z}}, lo.y, hi.y);
  add_slab(&o, {lo.x, lo.z}, {hi.x, hi.z}, lo.y, false);
  add_slab(&o, {lo.x, lo.z}, {hi.x, hi.z}, hi.y, true);
  return o;
}

/// A room over an L of two rectangles of 6 m × 2 m.
inline Object l_room() {
  Object o;
  o.name = "room";
  add_walls(&o, {{0, 0}, {6, 0}, {6, 2}, {2, 2}, {2, 6}, {0, 6}}, 0, 2.5f);
  for (const float y : {0.0f, 2.5f}) {
    add_slab(&o, {0, 0}, {2, 2}, y, y > 0);
    add_slab(&o, {2, 0}, {6, 2}, y, y > 0);
    add_slab(&o, {0, 2}, {2, 6}, y, y > 0);
  }
  return o;
}

inline Vec2 circle(int j, int m) {
  const double a = 2 * 3.14159265358979323846 * (j % m) / m;
  return {static_cast<float>(std::cos(a)), static_cast<float>(std::sin(a))};
}

inline Object column(float radius, float height, int m) {
  Object o;
  o.name = "column";
  std::vector<Vec2> outline;
  for (int j = 0; j < m; ++j) outline.push_back(circle(j, m) * radius);
  add_walls(&o, outline, 0, height);
  for (int j = 0; j < m; ++j) {
    const Vec2 p = outline[static_cast<size_t>(j)], q = outline[static_cast<size_t>((j + 1) % m)];
    add_triangle(&o, {0, height, 0}, {q.x, height, q.y}, {p.x, height, p.y});
    add_triangle(&o, {0, 0, 0}, {p.x, 0, p.y}, {q.x, 0, q.y});
  }
  return o;
}

/// n rings of 2n quads, triangles at the poles.
inline Object sphere(float radius, int n) {
  Object o;
  o.name = "sphere";
  const int m = 2 * n;
  const auto point = [&](int i, int j) {
    const double b = 3.14159265358979323846 * i / n;
    const float s = i == 0 || i == n ? 0.0f : static_cast<float>(std::sin(b));
    const Vec2 c = circle(j, m) * (s * radius);
    return Vec3{c.x, static_cast<float>(std::cos(b)) * radius, c.y};
  };
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j < m; ++j) {
      if (i > 0) add_triangle(&o, point(i, j), point(i, j + 1), point(i + 1, j + 1));
      if (i < n - 1) add_triangle(&o, point(i, j), point(i + 1, j + 1), point(i + 1, j));
    }
  }
  return o;
}

/// A spiral ramp of 24 quads a turn, each turn above the one before.
inline Object ramp(int turns) {
  Object o;
  o.name = "ramp";
  const auto point = [](int i, float r) {
    const Vec2 c = circle(i, 24) * r;
    return Vec3{c.x, 0.1f * static_cast<float>(i), c.y};
  };
  for (int i = 0; i < 24 * turns; ++i) add_quad(&o, point(i, 1), point(i + 1, 1), point(i + 1, 3), point(i, 3));
  return o;
}

inline Object plane(float width, float depth) {
  Object o;
  o.name = "plane";
  add_slab(&o, {0, 0}, {width, depth}, 0, true);
  return o;
}

}  // namespace lightloom::shapes
