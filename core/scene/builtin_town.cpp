// A town of 25 solid buildings on a grid of streets, 100 m across, in the sun: long distances, and much space
// that is inside of something.
#include <array>
#include <string>

#include "core/base/rng.h"
#include "core/scene/builtin_builder.h"
#include "core/scene/shapes.h"

namespace lightloom {
namespace {

constexpr int kBlocks = 5;
constexpr float kPitch = 20, kFoot = -0.3f;

/// A house with a ridge along z: closed, with its eaves at `eaves`.
void add_house(Object* o, Vec3 lo, Vec3 hi, float eaves, uint32_t wall, uint32_t roof) {
  const float x = (lo.x + hi.x) / 2;
  const auto at = [](float px, float y, float z) { return Vec3{px, y, z}; };
  add_quad(o, at(lo.x, lo.y, lo.z), at(lo.x, lo.y, hi.z), at(lo.x, eaves, hi.z), at(lo.x, eaves, lo.z), wall);
  add_quad(o, at(hi.x, lo.y, hi.z), at(hi.x, lo.y, lo.z), at(hi.x, eaves, lo.z), at(hi.x, eaves, hi.z), wall);
  add_quad(o, at(lo.x, lo.y, hi.z), at(hi.x, lo.y, hi.z), at(hi.x, eaves, hi.z), at(lo.x, eaves, hi.z), wall);
  add_quad(o, at(hi.x, lo.y, lo.z), at(lo.x, lo.y, lo.z), at(lo.x, eaves, lo.z), at(hi.x, eaves, lo.z), wall);
  add_triangle(o, at(lo.x, eaves, hi.z), at(hi.x, eaves, hi.z), at(x, hi.y, hi.z), wall);
  add_triangle(o, at(hi.x, eaves, lo.z), at(lo.x, eaves, lo.z), at(x, hi.y, lo.z), wall);
  add_quad(o, at(lo.x, eaves, lo.z), at(lo.x, eaves, hi.z), at(x, hi.y, hi.z), at(x, hi.y, lo.z), roof);
  add_quad(o, at(hi.x, eaves, hi.z), at(hi.x, eaves, lo.z), at(x, hi.y, lo.z), at(x, hi.y, hi.z), roof);
  add_quad(o, at(lo.x, lo.y, lo.z), at(hi.x, lo.y, lo.z), at(hi.x, lo.y, hi.z), at(lo.x, lo.y, hi.z), wall);
}

/// A tower of boxes that narrow upwards, each sunk into the one below.
void add_tower(Object* o, Vec3 lo, Vec3 hi, int tiers, uint32_t material) {
  for (int i = 0; i < tiers; ++i) {
    const float inset = 1.5f * static_cast<float>(i);
    const float bottom = i == 0 ? lo.y : hi.y * static_cast<float>(i) / static_cast<float>(tiers) - 0.3f;
    const float top = hi.y * static_cast<float>(i + 1) / static_cast<float>(tiers);
    add_box(o, {lo.x + inset, bottom, lo.z + inset}, {hi.x - inset, top, hi.z - inset}, material);
  }
}

}  // namespace

Scene make_town() {
  SceneBuilder s;
  const uint32_t ground = s.material("asphalt", {0.25f, 0.25f, 0.26f});
  const uint32_t roof = s.material("tiles", {0.55f, 0.22f, 0.14f});
  const std::array<uint32_t, 4> walls{
      s.material("plaster", {0.75f, 0.72f, 0.65f}), s.material("brick", {0.5f, 0.25f, 0.18f}),
      s.material("sandstone", {0.7f, 0.58f, 0.4f}), s.material("concrete", {0.5f, 0.52f, 0.55f})};
  const float edge = kPitch * kBlocks;
  add_box(s.object("ground"), {-2, -1, -2}, {edge + 2, 0, edge + 2}, ground);

  Rng rng(25);
  for (int x = 0; x < kBlocks; ++x) {
    for (int z = 0; z < kBlocks; ++z) {
      const float w = 5 + 2 * rng.next_float(), d = 5 + 2 * rng.next_float();  // half sizes
      const float cx = (static_cast<float>(x) + 0.5f) * kPitch, cz = (static_cast<float>(z) + 0.5f) * kPitch;
      const float height = 6 + 18 * rng.next_float();
      const uint32_t wall = walls[rng.next_below(4)];
      const Vec3 lo{cx - w, kFoot, cz - d}, hi{cx + w, height, cz + d};
      const bool house = (x + 2 * z) % 3 == 0;
      Object* o = s.object((house ? "house " : "tower ") + std::to_string(x) + "," + std::to_string(z));
      if (house) {
        add_house(o, lo, {hi.x, height * 0.5f + 4, hi.z}, height * 0.5f, wall, roof);
      } else {
        add_tower(o, lo, hi, 1 + static_cast<int>(rng.next_below(3)), wall);
      }
    }
  }

  Light sun;
  sun.type = LightType::kDirectional;
  sun.name = "sun";
  sun.direction = normalize({0.45f, -0.84f, -0.3f});
  sun.color = {1, 0.95f, 0.85f};
  sun.intensity = 5;
  s.light(sun);
  s.camera("above", {-16, 35, 116}, {60, 0, 40}, 0.9f, 16.0f / 9);
  s.camera("street", {20, 1.8f, 98}, {20, 4, 60}, 1.1f, 16.0f / 9);
  return s.finish();
}

}  // namespace lightloom
