// Levels as artists leave them: cracks, T-junctions, flipped, duplicate, degenerate and coplanar triangles, props sunk into
// the floor. Light stays finite and near the truth, nothing grows a dark rim, and what is reversed is named.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/receivers/reversed.h"
#include "core/scene/builtin.h"
#include "core/scene/defects.h"
#include "core/scene/gltf.h"
#include "core/scene/shapes.h"
#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

uint64_t not_finite(const Field& e) {
  return static_cast<uint64_t>(std::count_if(e.begin(), e.end(), [](Vec3 v) { return !is_finite(v); }));
}

Scene broken_room() {
  Scene scene = test::closed_box({4, 3, 4});
  const uint32_t stone = test::add_material(&scene, "stone", kGrey);
  Object& steps = scene.objects.emplace_back();
  steps.name = "steps";
  // Treads 5 mm apart along x = 1.
  add_quad(&steps, {0, 0.3f, 0}, {0, 0.3f, 4}, {1, 0.3f, 4}, {1, 0.3f, 0}, stone);
  add_quad(&steps, {1.005f, 0.3f, 0}, {1.005f, 0.3f, 2}, {1.5f, 0.3f, 2}, {1.5f, 0.3f, 0}, stone);
  add_quad(&steps, {1.005f, 0.3f, 2}, {1.005f, 0.3f, 4}, {1.5f, 0.3f, 4}, {1.5f, 0.3f, 2}, stone);
  // The corner at (1.5, 2) of the treads lies on the riser's edge.
  add_quad(&steps, {1.5f, 0.3f, 0}, {1.5f, 0.3f, 4}, {1.5f, 0, 4}, {1.5f, 0, 0}, stone);
  // A rug in the plane of the floor, given twice, a triangle without area, a shelf whose halves face opposite ways.
  Object& rug = scene.objects.emplace_back();
  rug.name = "rug";
  add_quad(&rug, {2, 0, 1}, {2, 0, 3}, {3.5f, 0, 3}, {3.5f, 0, 1}, stone);
  add_quad(&rug, {2, 0, 1}, {2, 0, 3}, {3.5f, 0, 3}, {3.5f, 0, 1}, stone);
  add_triangle(&rug, {2, 0, 1}, {2, 0, 1}, {3, 0, 1}, stone);
  Object& shelf = scene.objects.emplace_back();
  shelf.name = "shelf";
  add_triangle(&shelf, {2, 1.5f, 0}, {2, 1.5f, 0.4f}, {3, 1.5f, 0.4f}, stone);
  add_triangle(&shelf, {2, 1.5f, 0}, {3, 1.5f, 0.4f}, {3, 1.5f, 0}, stone);
  std::swap(shelf.triangles.back().v[1], shelf.triangles.back().v[2]);
  test::add_point_light(&scene, {2.5f, 2.4f, 2.5f}, 10);
  test::identify(&scene);
  return scene;
}

TEST(StabilityDefects, BrokenTrianglesStayFinite) {
  // Through a file, as an artist's level comes: triangles without area are left out there.
  const test::TemporaryFolder folder;
  ASSERT_TRUE(save_gltf(broken_room(), folder.path() / "broken.glb").ok());
  Scene scene = value_or_die(load_gltf(folder.path() / "broken.glb"));
  EXPECT_THAT(scene.warnings, ::testing::Contains(::testing::HasSubstr("without area")));
  const Defects defects = find_defects(scene);
  EXPECT_GT(defects.duplicates, 0u);
  EXPECT_GT(defects.flipped, 0u);
  EXPECT_GT(defects.t_junctions, 0u);
  EXPECT_GT(defects.cracks, 0u);
  const auto level = bake_at(std::move(scene), 1.5f, 6);
  const Field e = relight(*level, 8);
  const Truth truth = trace_truth(*level, 8, 1024);
  check({Case::kDefects, "texels that are not finite, broken room", static_cast<double>(not_finite(e)), 0}, [&] {
    return beside(*level, e, truth_field(*level, truth, e),
                  {.inside = true, .from = {3.8f, 2.7f, 3.8f}, .to = {1.5f, 0.6f, 1.5f}});
  });
  check({Case::kDefects, "rel_rmse, broken room", error(*level, e, truth).rel_rmse, 0.15});
}

// What is modelled inside out is named, and nothing else.
TEST(StabilityDefects, ReversedSurfacesAreNamed) {
  const auto named = [](const Scene& scene) {
    const auto tracer = value_or_die(RayTracer::create(scene));
    std::vector<std::string> names;
    for (const uint32_t o : reversed_objects(*tracer, {})) names.push_back(scene.objects[o].name);
    return names;
  };
  for (const std::string& name : builtin_scene_names()) {
    EXPECT_THAT(named(value_or_die(builtin_scene(name))), ::testing::IsEmpty()) << name;
  }
  Scene scene = test::room_with_crate();
  EXPECT_THAT(named(scene), ::testing::IsEmpty());
  for (Material& m : scene.materials) m.double_sided = false;
  const std::vector<std::string> reversed{"west", "crate"};
  for (const std::string& name : reversed) {
    for (Triangle& t : scene.objects[test::object_named(scene, name)].triangles) std::swap(t.v[1], t.v[2]);
  }
  test::identify(&scene);
  std::vector<std::string> missed, found = named(scene);
  EXPECT_THAT(found, ::testing::ElementsAreArray(reversed));
  for (const std::string& name : reversed) {
    if (std::find(found.begin(), found.end(), name) == found.end()) missed.push_back(name);
  }
  check({Case::kDefects, "reversed objects that are not named, of 2", static_cast<double>(missed.size()), 0});
}

TEST(StabilityDefects, PropSunkInTheFloorHasNoDarkRim) {
  Scene scene = test::closed_box({4, 3, 4});
  const uint32_t clay = test::add_material(&scene, "clay", kGrey);
  Object& pot = scene.objects.emplace_back();
  pot.name = "pot";
  add_sphere(&pot, {2, 0.25f, 2}, 0.4f, 32, clay);
  test::add_solid_box(&scene, "crate", {0.63f, -0.05f, 0.71f}, {1.27f, 0.5f, 1.33f}, clay);
  test::add_point_light(&scene, {2.5f, 2.4f, 3}, 10);
  test::identify(&scene);
  const auto level = bake_at(std::move(scene), 1.5f, 6);
  const Field e = relight(*level, 8, 64);
  const Truth truth = trace_truth(*level, 8, 1024);
  const Field traced = truth_field(*level, truth, e);
  const uint32_t floor = test::object_named(*level->scene, "floor");
  // The rim: floor within 1.5 texels of where the props enter it. A dark halo is E far below the truth there.
  const float reach = 1.5f / 6;
  double worst = 0, rim_e = 0, rim_true = 0;
  int texels = 0;
  for (size_t i = 0; i < e.size(); ++i) {
    const Receiver& r = level->elements.receivers.all[i];
    if (r.object != floor) continue;
    const Vec3 p = r.point.position;
    const float to_pot = std::abs(length(Vec3{p.x - 2, 0, p.z - 2}) - std::sqrt(0.4f * 0.4f - 0.25f * 0.25f));
    const float dx = std::max({0.63f - p.x, 0.0f, p.x - 1.27f}), dz = std::max({0.71f - p.z, 0.0f, p.z - 1.33f});
    if (to_pot > reach && std::sqrt(dx * dx + dz * dz) > reach) continue;
    ++texels;
    worst = std::max(worst, static_cast<double>(1 - e[i].x / traced[i].x));
    rim_e += area(*level, i) * static_cast<double>(e[i].x);
    rim_true += area(*level, i) * static_cast<double>(traced[i].x);
  }
  ASSERT_GT(texels, 20);
  check({Case::kDefects, "texels that are not finite, sunk props", static_cast<double>(not_finite(e)), 0},
        [&] { return beside(*level, e, traced); });
  check({Case::kDefects, "darkness of the rim, 1 − mean E ÷ mean truth", 1 - rim_e / rim_true, 0.05});
  check({Case::kDefects, "darkest texel of the rim, 1 − E ÷ truth", worst, 0.3});
}

}  // namespace
}  // namespace lightloom::stability
