// A museum of 4 × 3 halls with fluted columns, coffered ceilings, pictures and sculptures: about a quarter of
// a million triangles in many objects that can be moved. Solids that meet overlap and share no plane.
#include <array>
#include <string>
#include <vector>

#include "core/scene/builtin_builder.h"
#include "core/scene/shapes.h"

namespace lightloom {
namespace {

constexpr int kColumns = 4, kRows = 3;
constexpr float kPitch = 9, kHeight = 4.6f, kHalfWall = 0.15f, kHalfPier = 0.22f, kFoot = -0.002f;

struct Palette {
  uint32_t wall, ceiling, floor, marble, bronze, wood;
  std::array<uint32_t, 4> hues;
};

float line(int i) { return static_cast<float>(i) * kPitch; }
float middle(int i) { return (static_cast<float>(i) + 0.5f) * kPitch; }
std::string at(const char* what, int x, int z) {
  return std::string(what) + " " + std::to_string(x) + "," + std::to_string(z);
}

/// A slab whose underside has n × n recesses between beams.
void add_coffered_slab(Object* o, Vec3 lo, Vec3 hi, float recess, int n, uint32_t material) {
  const float cell = (hi.x - lo.x) / static_cast<float>(n), beam = cell * 0.15f;
  std::vector<float> us{0};
  for (int i = 0; i < n; ++i) {
    us.push_back(static_cast<float>(i) * cell + beam);
    us.push_back(static_cast<float>(i + 1) * cell - beam);
  }
  us.push_back(cell * static_cast<float>(n));
  const int last = static_cast<int>(us.size()) - 1;
  const auto u = [&](int i) { return us[static_cast<size_t>(i)]; };
  const auto x = [&](int i) { return lo.x + u(i); };
  const auto z = [&](int i) { return lo.z + u(i); };
  const auto deep = [](int i, int j) { return i % 2 == 1 && j % 2 == 1; };
  for (int i = 0; i < last; ++i) {
    for (int j = 0; j < last; ++j) {
      const float y = deep(i, j) ? lo.y + recess : lo.y;
      const float x0 = x(i), x1 = x(i + 1), z0 = z(j), z1 = z(j + 1);
      add_quad(o, {x0, y, z0}, {x1, y, z0}, {x1, y, z1}, {x0, y, z1}, material);
      add_quad(o, {x0, hi.y, z1}, {x1, hi.y, z1}, {x1, hi.y, z0}, {x0, hi.y, z0}, material);
      if (deep(i, j)) {  // four sides, seen from within
        add_quad(o, {x0, lo.y, z1}, {x0, lo.y, z0}, {x0, y, z0}, {x0, y, z1}, material);
        add_quad(o, {x1, lo.y, z0}, {x1, lo.y, z1}, {x1, y, z1}, {x1, y, z0}, material);
        add_quad(o, {x0, lo.y, z0}, {x1, lo.y, z0}, {x1, y, z0}, {x0, y, z0}, material);
        add_quad(o, {x1, lo.y, z1}, {x0, lo.y, z1}, {x0, y, z1}, {x1, y, z1}, material);
      }
    }
    const float a = u(i), b = u(i + 1);  // the outer sides, cut like the underside
    add_quad(o, {lo.x + b, lo.y, lo.z}, {lo.x + a, lo.y, lo.z}, {lo.x + a, hi.y, lo.z}, {lo.x + b, hi.y, lo.z},
             material);
    add_quad(o, {lo.x, lo.y, lo.z + a}, {lo.x, lo.y, lo.z + b}, {lo.x, hi.y, lo.z + b}, {lo.x, hi.y, lo.z + a},
             material);
    const float xe = x(last), ze = z(last);
    add_quad(o, {lo.x + a, lo.y, ze}, {lo.x + b, lo.y, ze}, {lo.x + b, hi.y, ze}, {lo.x + a, hi.y, ze}, material);
    add_quad(o, {xe, lo.y, lo.z + b}, {xe, lo.y, lo.z + a}, {xe, hi.y, lo.z + a}, {xe, hi.y, lo.z + b}, material);
  }
}

/// A fluted column, from the floor into the ceiling.
void add_column(Object* o, Vec3 foot, uint32_t material) {
  add_box(o, {foot.x - 0.36f, kFoot, foot.z - 0.36f}, {foot.x + 0.36f, 0.14f, foot.z + 0.36f}, material);
  add_box(o, {foot.x - 0.34f, kHeight - 0.12f, foot.z - 0.34f}, {foot.x + 0.34f, kHeight + 0.02f, foot.z + 0.34f},
          material);
  Lathe lathe;
  lathe.center = foot;
  lathe.flutes = 16;
  lathe.flute_depth = 0.09f;
  auto& p = lathe.profile;
  const float radius = 0.27f, bulge = 0.07f, height = 0.19f;
  p = {{0, height - bulge}, {radius, height - bulge}};
  const std::vector<Vec2> round = circle(16);
  for (size_t i = 0; i <= 8; ++i) {  // the base bulges by half a circle
    const Vec2 c = round[(12 + i) % 16];
    p.push_back({radius + bulge * c.x, height + bulge * c.y});
  }
  const float bottom = 0.3f, top = kHeight - 0.45f;
  p.push_back({radius, bottom});
  p.push_back({radius, bottom});
  for (int i = 0; i <= 16; ++i) {  // entasis: narrower towards the top
    const float t = static_cast<float>(i) / 16;
    p.push_back({0.26f - 0.04f * t * t, bottom + 0.05f + (top - bottom - 0.1f) * t, true});
  }
  p.push_back({0.23f, top});
  p.push_back({0.23f, top});
  for (int i = 1; i <= 6; ++i) {  // the capital opens to the abacus
    const float t = static_cast<float>(i) / 6;
    p.push_back({0.23f + 0.09f * t * t, top + 0.35f * t});
  }
  p.push_back(p.back());
  p.push_back({0, p.back().height});
  add_lathe(o, lathe, material);
}

void add_vase(Object* o, Vec3 foot, uint32_t material) {
  Lathe lathe;
  lathe.center = foot;
  lathe.profile = {{0, 0}, {0.14f, 0}, {0.14f, 0}};
  for (int i = 1; i <= 40; ++i) {  // a polynomial belly and neck
    const float t = static_cast<float>(i) / 40;
    lathe.profile.push_back({0.14f + t * (1 - t) * (1.6f - 1.5f * t) * 0.75f + 0.05f * t * t * t, 0.9f * t});
  }
  const float rim = lathe.profile.back().radius;
  lathe.profile.insert(lathe.profile.end(), {{rim - 0.03f, 0.9f}, {rim - 0.03f, 0.9f}, {0.09f, 0.6f}, {0, 0.55f}});
  add_lathe(o, lathe, material);
}

void add_sculpture(Object* o, int kind, Vec3 foot, uint32_t material) {
  const Vec3 up{0, 1, 0};
  switch (kind) {
    case 0:
      return add_sphere(o, foot + up * 0.44f, 0.45f, 64, material);
    case 1:
      return add_torus(o, foot + up * 0.54f, 2, 0.4f, 0.15f, 64, material);
    case 2:
      return add_vase(o, foot - up * 0.005f, material);
    default:
      for (const auto& [height, radius] : {Vec2{0.24f, 0.25f}, Vec2{0.6f, 0.19f}, Vec2{0.88f, 0.14f}}) {
        add_sphere(o, foot + up * height, radius, 64, material);
      }
  }
}

/// A framed picture on the south wall of a hall, sunk into it.
void add_picture(SceneBuilder* s, int x, int z, float offset, const Palette& m) {
  const float cx = middle(x) + offset, wall = line(z + 1) - kHalfWall;
  const std::string side = offset < 0 ? " west" : " east";
  Object* frame = s->object(at("frame", x, z) + side);
  const float w = 0.9f, y0 = 1.3f, y1 = 2.6f, t = 0.08f, front = wall - 0.06f, back = wall + 0.02f;
  add_wall(frame, {cx - w, y0, front}, {cx + w, y1, back}, 2, {{cx - w + t, cx + w - t, y0 + t, y1 - t}}, m.wood,
           m.wood);
  const uint32_t hue = m.hues[static_cast<size_t>(x + 2 * z + (offset < 0 ? 1 : 0)) % 4];
  add_box(s->object(at("picture", x, z) + side), {cx - w + 0.02f, y0 + 0.02f, wall - 0.02f},
          {cx + w - 0.02f, y1 - 0.02f, wall + 0.01f}, hue);
}

void add_shell(SceneBuilder* s, const Palette& m) {
  const float xe = line(kColumns), ze = line(kRows);
  add_box(s->object("floor"), {-0.5f, -0.3f, -0.5f}, {xe + 0.5f, 0, ze + 0.5f}, m.floor);
  Object* piers = s->object("piers");
  for (int x = 0; x <= kColumns; ++x) {
    for (int z = 0; z <= kRows; ++z) {
      add_box(piers, {line(x) - kHalfPier, -0.2f, line(z) - kHalfPier},
              {line(x) + kHalfPier, kHeight + 0.65f, line(z) + kHalfPier}, m.wall);
    }
  }
  const float y0 = -0.1f, y1 = kHeight + 0.6f;
  for (int x = 0; x <= kColumns; ++x) {
    for (int z = 0; z <= kRows; ++z) {
      // Doorways lead from hall to hall, but for two walls, so that there are ways round.
      if (x < kColumns) {
        std::vector<Opening> door;
        if (z > 0 && z < kRows && (x + z) % 4 != 0) door = {{middle(x) - 1, middle(x) + 1, y0, 3}};
        add_wall(s->object(at("wall x", x, z)), {line(x), y0, line(z) - kHalfWall},
                 {line(x + 1), y1, line(z) + kHalfWall}, 2, door, m.wall, m.wall);
      }
      if (z < kRows) {
        std::vector<Opening> door;
        if (x > 0 && x < kColumns) door = {{middle(z) - 1, middle(z) + 1, y0, 3}};
        add_wall(s->object(at("wall z", x, z)), {line(x) - kHalfWall, y0, line(z)},
                 {line(x) + kHalfWall, y1, line(z + 1)}, 0, door, m.wall, m.wall);
      }
    }
  }
}

}  // namespace

Scene make_gallery() {
  SceneBuilder s;
  Palette m{};
  m.wall = s.material("plaster", {0.72f, 0.7f, 0.66f});
  m.ceiling = s.material("stucco", {0.8f, 0.8f, 0.78f});
  m.floor = s.material("parquet", {0.4f, 0.27f, 0.16f});
  m.marble = s.material("marble", {0.78f, 0.76f, 0.74f});
  m.bronze = s.material("bronze", {0.35f, 0.24f, 0.12f});
  m.wood = s.material("gilt", {0.6f, 0.45f, 0.15f});
  m.hues = {s.material("crimson", {0.6f, 0.08f, 0.1f}), s.material("ultramarine", {0.1f, 0.15f, 0.6f}),
            s.material("viridian", {0.1f, 0.45f, 0.3f}), s.material("ochre", {0.65f, 0.45f, 0.12f})};
  add_shell(&s, m);
  for (int x = 0; x < kColumns; ++x) {
    for (int z = 0; z < kRows; ++z) {
      const float inset = 0.05f;  // into the walls
      add_coffered_slab(s.object(at("ceiling", x, z)), {line(x) + inset, kHeight, line(z) + inset},
                        {line(x + 1) - inset, kHeight + 0.5f, line(z + 1) - inset}, 0.3f, 5, m.ceiling);
      int corner = 0;
      for (const float dx : {-2.8f, 2.8f}) {
        for (const float dz : {-2.8f, 2.8f}) {
          Object* column = s.object(at("column", x, z) + "," + std::to_string(corner++));
          add_column(column, {middle(x) + dx, 0, middle(z) + dz}, m.marble);
        }
      }
      const Vec3 foot{middle(x), 1, middle(z)};
      Object* pedestal = s.object(at("pedestal", x, z));
      add_box(pedestal, {foot.x - 0.4f, kFoot, foot.z - 0.4f}, {foot.x + 0.4f, 0.12f, foot.z + 0.4f}, m.marble);
      add_box(pedestal, {foot.x - 0.32f, 0.1f, foot.z - 0.32f}, {foot.x + 0.32f, 0.95f, foot.z + 0.32f}, m.marble);
      add_box(pedestal, {foot.x - 0.38f, 0.93f, foot.z - 0.38f}, {foot.x + 0.38f, 1, foot.z + 0.38f}, m.marble);
      const int kind = (x + z) % 4;
      add_sculpture(s.object(at("sculpture", x, z)), kind, foot, kind % 2 ? m.bronze : m.hues[static_cast<size_t>(x)]);
      add_picture(&s, x, z, -2.6f, m);
      add_picture(&s, x, z, 2.6f, m);
      if ((x + z) % 2 == 0) {
        s.point_light(at("lamp", x, z), {middle(x) + 1.2f, 3.8f, middle(z) - 1.2f}, {1, 0.92f, 0.8f}, 12);
      }
    }
  }
  Light spot;
  spot.type = LightType::kSpot;
  spot.name = "spot";
  spot.position = {middle(1) + 1.5f, 4.2f, middle(0) + 1.5f};
  spot.direction = normalize(Vec3{middle(1), 1.4f, middle(0)} - spot.position);
  spot.color = {1, 1, 0.95f};
  spot.intensity = 40;
  spot.inner_cone_angle = 0.25f;
  spot.outer_cone_angle = 0.4f;
  s.light(spot);
  s.camera("hall", {middle(1) - 3.7f, 1.7f, middle(1) - 1.4f}, {middle(1) + 2, 1.5f, middle(1) + 1}, 1.1f, 16.0f / 9);
  s.camera("enfilade", {0.8f, 1.7f, middle(1)}, {line(kColumns), 1.5f, middle(1)}, 0.9f, 16.0f / 9);
  return s.finish();
}

}  // namespace lightloom
