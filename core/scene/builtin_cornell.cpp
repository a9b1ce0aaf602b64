// The Cornell box, as measured: Cornell University Program of Computer Graphics, "Cornell Box Data", 1998.
// Millimetres become centimetres here, so that the box is a room of 5.5 m.
#include <array>

#include "core/scene/builtin_builder.h"
#include "core/scene/shapes.h"

namespace lightloom {
namespace {

/// A box without a bottom, from the four corners of its top, counter-clockwise seen from above.
void add_block(Object* object, const std::array<Vec2, 4>& top, float height, uint32_t material) {
  std::array<Vec3, 4> p;
  for (size_t i = 0; i < 4; ++i) p[i] = {top[i].x, height, top[i].y};
  add_quad(object, p[0], p[1], p[2], p[3], material);
  for (size_t i = 0; i < 4; ++i) {
    const Vec3 a = p[i], b = p[(i + 1) % 4];
    add_quad(object, {a.x, 0, a.z}, {b.x, 0, b.z}, b, a, material);
  }
}

}  // namespace

Scene make_cornell() {
  SceneBuilder s;
  const uint32_t white = s.material("white", {0.73f, 0.73f, 0.73f});
  const uint32_t red = s.material("red", {0.65f, 0.05f, 0.05f});
  const uint32_t green = s.material("green", {0.12f, 0.45f, 0.15f});

  const float h = 5.488f, d = 5.592f;
  add_quad(s.object("floor"), {5.528f, 0, 0}, {0, 0, 0}, {0, 0, d}, {5.496f, 0, d}, white);
  add_quad(s.object("ceiling"), {5.56f, h, 0}, {5.56f, h, d}, {0, h, d}, {0, h, 0}, white);
  add_quad(s.object("back"), {5.496f, 0, d}, {0, 0, d}, {0, h, d}, {5.56f, h, d}, white);
  add_quad(s.object("right"), {0, 0, d}, {0, 0, 0}, {0, h, 0}, {0, h, d}, green);
  add_quad(s.object("left"), {5.528f, 0, 0}, {5.496f, 0, d}, {5.56f, h, d}, {5.56f, h, 0}, red);
  add_block(s.object("short box"), {{{1.30f, 0.65f}, {0.82f, 2.25f}, {2.40f, 2.72f}, {2.90f, 1.14f}}}, 1.65f, white);
  add_block(s.object("tall box"), {{{4.23f, 2.47f}, {2.65f, 2.96f}, {3.14f, 4.56f}, {4.72f, 4.06f}}}, 3.30f, white);

  s.point_light("key", {2.78f, 4, 2.795f}, {1, 1, 1}, 20);
  s.camera("front", {2.78f, 2.73f, -8}, {2.78f, 2.73f, 0}, 0.6858f, 1);
  return s.finish();
}

}  // namespace lightloom
