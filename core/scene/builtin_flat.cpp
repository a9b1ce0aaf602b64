// A furnished flat of three rooms and a sealed store room: 9 × 7 × 2.6 m. Solids that meet overlap, and never
// share a plane: walls end inside walls, slabs are wider than walls, furniture stands 2 mm deep in the floor.
#include "core/scene/builtin_builder.h"
#include "core/scene/shapes.h"

namespace lightloom {
namespace {

constexpr float kFoot = -0.002f;

struct Palette {
  uint32_t plaster, red, blue, yellow, floor, wood, dark, cloth, metal;
};

/// A slab on four legs.
void add_table(Object* o, Vec3 lo, Vec3 hi, float leg, uint32_t top, uint32_t legs) {
  add_box(o, {lo.x, hi.y - 0.04f, lo.z}, hi, top);
  const float inset = 0.03f;
  for (const float x : {lo.x + inset, hi.x - inset - leg}) {
    for (const float z : {lo.z + inset, hi.z - inset - leg}) {
      add_box(o, {x, kFoot, z}, {x + leg, hi.y - 0.02f, z + leg}, legs);
    }
  }
}

/// Upright boards with shelves between them; open towards +z, or +x if `along_z`.
void add_shelf(Object* o, Vec3 lo, Vec3 hi, bool along_z, int shelves, uint32_t material) {
  const float t = 0.03f, sink = 0.01f;
  const auto box = [&](float u0, float u1, float w0, float w1, float y0, float y1) {
    along_z ? add_box(o, {w0, y0, u0}, {w1, y1, u1}, material) : add_box(o, {u0, y0, w0}, {u1, y1, w1}, material);
  };
  const float u0 = along_z ? lo.z : lo.x, u1 = along_z ? hi.z : hi.x;  // width
  const float w0 = along_z ? lo.x : lo.z, w1 = along_z ? hi.x : hi.z;  // depth
  box(u0, u0 + t, w0, w1, kFoot, hi.y);
  box(u1 - t, u1, w0, w1, kFoot, hi.y);
  box(u0 + t - sink, u1 - t + sink, w0 + 0.005f, w0 + 0.02f, 0.02f, hi.y - 0.005f);
  for (int i = 0; i < shelves; ++i) {
    const float y = 0.08f + (hi.y - 0.13f) * static_cast<float>(i) / static_cast<float>(shelves - 1);
    box(u0 + t - sink, u1 - t + sink, w0 + 0.01f, w1 - 0.01f, y, y + t);
  }
}

void add_shell(SceneBuilder* s, const Palette& m) {
  add_box(s->object("floor"), {-0.15f, -0.2f, -0.15f}, {9.15f, 0, 7.15f}, m.floor);
  add_box(s->object("ceiling"), {-0.15f, 2.6f, -0.15f}, {9.15f, 2.8f, 7.15f}, m.plaster);
  const float y0 = -0.05f, y1 = 2.65f, door = 2.05f;
  add_wall(s->object("wall south"), {-0.11f, y0, -0.1f}, {9.11f, y1, 0}, 2,
           {{1.2f, 3, 0.9f, 2.2f}, {6.4f, 7.8f, 0.9f, 2.2f}}, m.plaster, m.plaster);
  add_wall(s->object("wall north"), {-0.11f, y0, 7}, {9.11f, y1, 7.1f}, 2, {}, m.plaster, m.plaster);
  add_wall(s->object("wall west"), {-0.1f, y0, -0.05f}, {0, y1, 7.05f}, 0, {{5, 6.2f, 1.1f, 2.1f}}, m.plaster, m.red);
  add_wall(s->object("wall east"), {9, y0, -0.05f}, {9.1f, y1, 7.05f}, 0, {{2.6f, 4.4f, 0.8f, 2.2f}}, m.blue,
           m.plaster);
  add_wall(s->object("wall bedroom"), {5.35f, y0, -0.05f}, {5.45f, y1, 7.05f}, 0, {{1.2f, 2.1f, y0, door}}, m.plaster,
           m.blue);
  add_wall(s->object("wall kitchen"), {-0.05f, y0, 3.95f}, {5.4f, y1, 4.05f}, 2, {{0.8f, 1.7f, y0, door}}, m.plaster,
           m.yellow);
  add_wall(s->object("wall store"), {3.35f, y0, 4}, {3.45f, y1, 7.05f}, 0, {}, m.yellow, m.plaster);
}

void add_living_room(SceneBuilder* s, const Palette& m) {
  Object* sofa = s->object("sofa");
  add_box(sofa, {3.2f, kFoot, 0.25f}, {5.2f, 0.4f, 1.05f}, m.cloth);
  add_box(sofa, {3.22f, 0.38f, 0.27f}, {5.18f, 0.85f, 0.5f}, m.cloth);
  add_box(sofa, {3.18f, 0.1f, 0.23f}, {3.4f, 0.6f, 1.07f}, m.cloth);
  add_box(sofa, {5, 0.1f, 0.23f}, {5.22f, 0.6f, 1.07f}, m.cloth);
  add_table(s->object("coffee table"), {3.6f, 0, 1.5f}, {4.8f, 0.45f, 2.1f}, 0.05f, m.wood, m.metal);
  add_table(s->object("dining table"), {1.9f, 0, 2.3f}, {3.3f, 0.74f, 3.2f}, 0.06f, m.wood, m.wood);
  add_shelf(s->object("bookshelf"), {0.02f, 0, 0.9f}, {0.32f, 2, 2.1f}, true, 6, m.dark);
  add_box(s->object("rug"), {3.3f, kFoot, 1.25f}, {5.1f, 0.012f, 2.6f}, m.red);
  add_box(s->object("sideboard"), {4.1f, kFoot, 3.5f}, {5.3f, 0.7f, 3.92f}, m.dark);
}

void add_kitchen(SceneBuilder* s, const Palette& m) {
  Object* counter = s->object("kitchen counter");
  add_box(counter, {0.35f, kFoot, 6.42f}, {3, 0.87f, 6.98f}, m.wood);
  add_box(counter, {0.33f, 0.86f, 6.38f}, {3.02f, 0.9f, 6.99f}, m.metal);
  add_box(s->object("wall cupboard"), {0.6f, 1.5f, 6.65f}, {2.6f, 2.2f, 7.02f}, m.wood);
  add_box(s->object("fridge"), {2.6f, kFoot, 4.5f}, {3.25f, 1.8f, 5.1f}, m.metal);
  add_table(s->object("kitchen table"), {1.2f, 0, 4.9f}, {2, 0.74f, 5.7f}, 0.05f, m.plaster, m.metal);
}

void add_bedroom(SceneBuilder* s, const Palette& m) {
  Object* bed = s->object("bed");
  add_box(bed, {6.9f, kFoot, 4.9f}, {8.9f, 0.3f, 6.6f}, m.wood);
  add_box(bed, {6.95f, 0.28f, 4.95f}, {8.88f, 0.55f, 6.55f}, m.cloth);
  add_box(bed, {8.86f, 0.05f, 4.88f}, {8.94f, 1, 6.62f}, m.wood);
  add_box(s->object("wardrobe"), {5.55f, kFoot, 3.4f}, {6.15f, 2.1f, 5.4f}, m.dark);
  add_table(s->object("desk"), {7.4f, 0, 0.15f}, {8.9f, 0.74f, 0.85f}, 0.05f, m.wood, m.metal);
  add_shelf(s->object("low shelf"), {5.6f, 0, 6.6f}, {6.6f, 0.9f, 6.95f}, false, 3, m.wood);
}

}  // namespace

Scene make_flat() {
  SceneBuilder s;
  Palette m{};
  m.plaster = s.material("plaster", {0.75f, 0.73f, 0.7f});
  m.red = s.material("red", {0.6f, 0.15f, 0.12f});
  m.blue = s.material("blue", {0.25f, 0.35f, 0.65f});
  m.yellow = s.material("yellow", {0.75f, 0.62f, 0.25f});
  m.floor = s.material("floorboards", {0.45f, 0.32f, 0.2f});
  m.wood = s.material("wood", {0.55f, 0.4f, 0.25f});
  m.dark = s.material("dark wood", {0.2f, 0.12f, 0.08f});
  m.cloth = s.material("cloth", {0.3f, 0.45f, 0.35f});
  m.metal = s.material("metal", {0.6f, 0.6f, 0.62f});
  add_shell(&s, m);
  add_living_room(&s, m);
  add_kitchen(&s, m);
  add_bedroom(&s, m);
  add_box(s.object("crate large"), {4.3f, kFoot, 5.6f}, {5.1f, 0.8f, 6.5f}, m.wood);
  add_box(s.object("crate small"), {4.4f, 0.798f, 5.8f}, {4.9f, 1.2f, 6.3f}, m.wood);

  s.point_light("living room", {2.7f, 2.2f, 2}, {1, 0.9f, 0.75f}, 8);
  s.point_light("kitchen", {1.7f, 2.2f, 5.6f}, {1, 1, 1}, 6);
  s.point_light("bedroom", {7.4f, 2.1f, 3}, {0.8f, 0.9f, 1}, 6);
  s.camera("living room", {0.5f, 1.6f, 3.6f}, {4.6f, 1, 0.9f}, 1.1f, 16.0f / 9);
  s.camera("bedroom", {5.8f, 1.6f, 0.5f}, {8.2f, 0.8f, 5}, 1.1f, 16.0f / 9);
  return s.finish();
}

}  // namespace lightloom
