// Levels and clusters of next to nothing: a defined result, or one line that says what is missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "core/scene/shapes.h"
#include "tests/stability/lit_level.h"
#include "tests/stability/row.h"

namespace lightloom::stability {
namespace {

BakeParams coarse() {
  BakeParams params;
  params.spacing = 1;
  params.texels_per_metre = 2;
  params.relight_rays = 1024;
  return params;
}

/// 0 if the closed form holds everywhere to 1 %.
double wrong(const BakedLevel& level, const Field& e, float expected) {
  double count = 0;
  for (const Vec3 v : e) count += !(std::abs(v.x - expected) <= 0.01f * std::max(expected, 1e-6f));
  EXPECT_FALSE(e.empty());
  EXPECT_EQ(e.size(), level.report.receivers);
  return count;
}

/// Wrong texels under a sky of 1, which every receiver of an open scene sees whole: E = π.
void check_open(const std::string& what, Scene scene, const BakeParams& params) {
  scene.environment = {1, 1, 1};
  const auto level = bake_level(std::move(scene), params);
  double count = 0;
  for (const Device device : {Device::kCpu, Device::kSimd, Device::kVulkan}) {
    count += wrong(*level, relight(*level, 2, 16, device), kPi);
  }
  check({Case::kDegenerate, "texels off the closed form, " + what, count, 0}, [&] {
    float exposure = 0;
    return picture(*level, relight(*level, 2), {}, &exposure);
  });
}

Scene one_triangle() {
  Scene scene;
  const uint32_t grey = test::add_material(&scene, "grey", {0.5f, 0.5f, 0.5f});
  Object& object = scene.objects.emplace_back();
  object.name = "triangle";
  add_triangle(&object, {0, 0, 0}, {0, 0, 2}, {2, 0, 0}, grey);
  test::identify(&scene);
  return scene;
}

TEST(StabilityDegenerate, OneTriangle) { check_open("one triangle", one_triangle(), coarse()); }

TEST(StabilityDegenerate, SingleReceiver) {
  BakeParams params = coarse();
  params.texels_per_metre = 1;
  Scene scene = test::open_plane(0.5f, {});
  scene.objects[0].uv1.clear();  // an atlas of its own: one texel
  test::identify(&scene);
  const auto level = bake_level(scene, params);
  ASSERT_EQ(level->report.receivers, 1u);
  check_open("a single receiver", std::move(scene), params);
}

// All rows of the transport are the same, but for noise: only the uniform field is there.
TEST(StabilityDegenerate, RankDeficientCluster) {
  Scene scene = test::open_plane(3, {});
  check_open("a cluster whose receivers all see the same", std::move(scene), coarse());
}

TEST(StabilityDegenerate, NoTexcoord1) {
  Scene scene = test::open_plane(3, {});
  for (Object& o : scene.objects) o.uv1.clear();
  test::identify(&scene);
  check_open("no TEXCOORD_1", std::move(scene), coarse());
}

TEST(StabilityDegenerate, NoLightsAreDarkness) {
  const auto level = bake_level(test::closed_box({3, 3, 3}), coarse());
  double count = 0;
  for (const Device device : {Device::kCpu, Device::kSimd, Device::kVulkan}) {
    for (const Vec3 v : relight(*level, 4, 16, device)) count += v != Vec3{};
  }
  check({Case::kDegenerate, "texels that are not black, no lights", count, 0});
}

// Black walls reflect nothing, whatever shines on them.
TEST(StabilityDegenerate, BlackWallsAreDarkness) {
  std::array<test::Wall, 6> walls;
  walls.fill({{0, 0, 0}, {}});
  Scene scene = test::closed_box({3, 3, 3}, walls);
  test::add_point_light(&scene, {1, 1, 1}, 10);
  const auto level = bake_level(std::move(scene), coarse());
  double count = 0;
  for (const Vec3 v : relight(*level, 4)) count += v != Vec3{};
  check({Case::kDegenerate, "texels that are not black, black walls", count, 0});
}

/// The error of a bake that must fail.
std::string refusal(const Scene& scene) {
  const auto tracer = RayTracer::create(scene);
  if (!tracer.ok()) return std::string(tracer.status().message());
  const test::TemporaryFolder folder;
  const auto result = bake(**tracer, coarse(), folder.path() / "x.loom", {});
  EXPECT_FALSE(result.ok());
  return std::string(result.status().message());
}

TEST(StabilityDegenerate, NothingToBakeIsAnError) {
  Scene dynamic = one_triangle();
  dynamic.objects[0].is_static = false;
  test::identify(&dynamic);
  double refused = 0;
  for (const Scene& scene : {Scene{}, dynamic}) {
    const std::string error = refusal(scene);
    EXPECT_THAT(error, ::testing::HasSubstr("static objects that receive a lightmap"));
    EXPECT_EQ(error.find('\n'), std::string::npos);
    refused += error.find("give the level static objects") != std::string::npos;
  }
  check({Case::kDegenerate, "empty or dynamic levels without a clear error", 2 - refused, 0});
}

}  // namespace
}  // namespace lightloom::stability
