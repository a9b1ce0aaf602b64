#include "cli/view/picking.h"

#include <gtest/gtest.h>

#include "core/scene/builtin.h"

namespace lightloom::view {
namespace {

/// In the middle of Cornell's box, at its open front, looking in; 2:1.
Camera camera() {
  Camera c;
  c.position = {1, 2, 5};
  c.yfov = 1.5707963f;  // half its height is as far as the picture
  c.aspect = 2;
  return c;
}

TEST(Picking, RaysGoThroughCornersAndCentre) {
  EXPECT_LT(length(ray_through(camera(), {0.5f, 0.5f}).direction - Vec3{0, 0, -1}), 1e-5f);
  EXPECT_LT(length(ray_through(camera(), {0, 0}).direction - normalize({-2, 1, -1})), 1e-5f);
  EXPECT_LT(length(ray_through(camera(), {1, 1}).direction - normalize({2, -1, -1})), 1e-5f);
  EXPECT_EQ(ray_through(camera(), {1, 1}).origin, camera().position);
}

TEST(Picking, WhatIsOnScreenIsWhereItsRayGoes) {
  for (const Vec2 at : {Vec2{0.5f, 0.5f}, Vec2{0.1f, 0.8f}, Vec2{0.95f, 0.2f}}) {
    const Ray ray = ray_through(camera(), at);
    const auto seen = on_screen(camera(), ray.origin + ray.direction * 3.7f);
    ASSERT_TRUE(seen);
    EXPECT_NEAR(seen->x, at.x, 1e-5);
    EXPECT_NEAR(seen->y, at.y, 1e-5);
  }
  EXPECT_FALSE(on_screen(camera(), camera().position + Vec3{0, 0, 1}));
}

TEST(Picking, ADraggedPointStaysUnderTheMouseAndInItsPlane) {
  const Vec3 point{1.5f, 2.25f, 2};
  const Vec2 from = *on_screen(camera(), point), to{0.3f, 0.9f};
  const Vec3 moved = point + drag_in_view(camera(), point, from, to);
  EXPECT_NEAR(moved.z, point.z, 1e-5);
  const auto seen = on_screen(camera(), moved);
  ASSERT_TRUE(seen);
  EXPECT_NEAR(seen->x, to.x, 1e-5);
  EXPECT_NEAR(seen->y, to.y, 1e-5);
}

TEST(Picking, FindsTheNearestObject) {
  const Scene scene = *builtin_scene("cornell");
  const auto tracer = std::move(*RayTracer::create(scene));
  const Camera front = scene.cameras[0];
  for (const Object& object : scene.objects) {
    if (object.name != "short box" && object.name != "tall box") continue;
    Aabb box;
    for (const Vec3 p : object.positions) box.extend(p);
    const auto picked = pick_object(*tracer, front, *on_screen(front, box.center()));
    ASSERT_TRUE(picked) << object.name;
    EXPECT_EQ(scene.objects[*picked].name, object.name);
  }
  Camera away = front;
  away.forward = -front.forward;
  away.right = -front.right;
  EXPECT_FALSE(pick_object(*tracer, away, {0.5f, 0.5f}));
}

}  // namespace
}  // namespace lightloom::view
