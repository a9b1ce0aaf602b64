// Lights that no prior of incoming light expects (after Lehtinen's and others' precomputed-light papers: an emissive door,
// sun through a slit, a narrow coloured spot). This method has no prior: its error is that of any other light.
#include <gtest/gtest.h>

#include "core/scene/shapes.h"
#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

constexpr Vec3 kWhite{0.7f, 0.7f, 0.7f};

void check_error(const BakedLevel& level, const std::string& what, double bound, int bounces, const Truth& truth) {
  const Field e = relight(level, bounces, 1024);
  const Comparison all = error(level, e, truth);
  std::printf("%s: rel_rmse %.4f (noise %.4f), bias %+.4f, p99 %.3f\n", what.c_str(), all.rel_rmse, truth.noise,
              all.bias, all.p99);
  check({Case::kUnexpectedLights, "rel_rmse, " + what, all.rel_rmse, bound},
        [&] { return beside(level, e, truth_field(level, truth, e)); });
  check({Case::kUnexpectedLights, "|energy − 1|, " + what, std::abs(all.bias), 0.05});
}

/// Two rooms of 3 m with a doorway of 1 m × 2 m between them.
Scene two_rooms() {
  Scene scene = test::closed_box(
      {6, 3, 4}, {{{kWhite, {}}, {kWhite, {}}, {kWhite, {}}, {kWhite, {}}, {kWhite, {}}, {kWhite, {}}}});
  const uint32_t wall = test::add_material(&scene, "wall", kWhite);
  Object& divider = scene.objects.emplace_back();
  divider.name = "divider";
  add_wall(&divider, {2.95f, 0, 0}, {3.05f, 3, 4}, 0, {{1.5f, 2.5f, 0, 2}}, wall, wall);
  test::identify(&scene);
  return scene;
}

TEST(StabilityUnexpectedLights, EmissiveDoor) {
  Scene scene = two_rooms();
  const uint32_t glow = test::add_material(&scene, "door", {0.2f, 0.2f, 0.2f}, {4, 3, 2});
  scene.materials[glow].double_sided = true;
  test::add_wall_object(&scene, "door", {2.99f, 0, 1.5f}, {2.99f, 0, 2.5f}, {2.99f, 2, 2.5f}, {2.99f, 2, 1.5f}, glow);
  test::identify(&scene);
  const auto level = bake_at(std::move(scene), 1.5f, 5);
  check_error(*level, "emissive door", 0.2, 16, trace_truth(*level, 15, 2048));
  // The door is shut, and its back does not shine.
  const Field e = relight(*level, 16);
  const auto x_within = [](float lo, float hi) {
    return [=](const Receiver& r) { return r.point.position.x > lo && r.point.position.x < hi; };
  };
  check({Case::kSealedRooms, "leak, past a shut emissive door",
         mean(*level, e, x_within(3.049f, 7)) / mean(*level, e, x_within(-1, 2.951f)), 1e-3});
}

TEST(StabilityUnexpectedLights, SunThroughASlit) {
  Scene scene = two_rooms();
  Object& ceiling = scene.objects[test::object_named(scene, "ceiling")];
  const uint32_t material = ceiling.triangles[0].material;
  scene.objects.erase(scene.objects.begin() + test::object_named(scene, "ceiling"));
  test::add_wall_object(&scene, "ceiling west", {0, 3, 0}, {1, 3, 0}, {1, 3, 4}, {0, 3, 4}, material);
  test::add_wall_object(&scene, "ceiling east", {1.05f, 3, 0}, {6, 3, 0}, {6, 3, 4}, {1.05f, 3, 4}, material);
  Light sun;
  sun.type = LightType::kDirectional;
  sun.direction = normalize({0.3f, -1, 0.1f});
  sun.intensity = 50;
  scene.lights.push_back(sun);
  test::identify(&scene);
  const auto level = bake_at(std::move(scene), 1.5f, 5);
  check_error(*level, "sun through a slit of 5 cm", 0.35, 1, trace_from_lamps(*level, 1000000));
}

TEST(StabilityUnexpectedLights, NarrowColouredSpot) {
  Scene scene = two_rooms();
  test::add_point_light(&scene, {1, 2.8f, 1}, 100);
  Light& spot = scene.lights.back();
  spot.type = LightType::kSpot;
  spot.color = {0.1f, 0.2f, 1};
  spot.direction = normalize({1, -0.6f, 0.5f});
  spot.inner_cone_angle = 0.05f;
  spot.outer_cone_angle = 0.08f;
  const auto level = bake_at(std::move(scene), 1.5f, 5);
  check_error(*level, "narrow blue spot", 0.35, 1, trace_from_lamps(*level, 16384));
}

}  // namespace
}  // namespace lightloom::stability
