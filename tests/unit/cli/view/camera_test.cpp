#include "cli/view/camera.h"

#include <gtest/gtest.h>

#include "core/scene/builtin.h"

namespace lightloom::view {
namespace {

void expect_near(Vec3 a, Vec3 b, float tolerance = 1e-5f) { EXPECT_LT(length(a - b), tolerance) << a.x << " " << a.y; }

TEST(FlyCamera, YawAndPitchAsTheHeaderSays) {
  FlyCamera fly;
  fly.stand({1, 2, 3}, 0, 0);
  expect_near(fly.camera(1).forward, {0, 0, -1});
  expect_near(fly.camera(1).right, {1, 0, 0});
  fly.stand({1, 2, 3}, 90, 0);
  expect_near(fly.camera(1).forward, {-1, 0, 0});
  fly.stand({1, 2, 3}, 0, 30);
  expect_near(fly.camera(1).forward, {0, 0.5f, -std::sqrt(0.75f)});
  expect_near(fly.camera(1).position, {1, 2, 3});
}

TEST(FlyCamera, ItsFrameIsRightHandedAndOrthonormal) {
  FlyCamera fly;
  fly.stand({}, 33, -71);
  const Camera c = fly.camera(1.5f);
  expect_near(cross(c.right, c.up), -c.forward);
  EXPECT_NEAR(length(c.up), 1, 1e-5);
  EXPECT_NEAR(c.right.y, 0, 1e-6);
  EXPECT_EQ(c.aspect, 1.5f);
}

TEST(FlyCamera, StandsExactlyWhereTheLevelsCameraStands) {
  Camera rolled = builtin_scene("flat")->cameras[0];
  std::swap(rolled.right, rolled.up);
  rolled.right = -rolled.right;
  FlyCamera fly;
  fly.stand(rolled);
  EXPECT_EQ(fly.camera(2).up, rolled.up);
  EXPECT_EQ(fly.camera(2).yfov, rolled.yfov);
  fly.turn(0.001f, 0);  // the first turn takes the roll out, and hardly changes where it looks
  EXPECT_NEAR(fly.camera(2).right.y, 0, 1e-6);
  EXPECT_LT(length(fly.camera(2).forward - rolled.forward), 0.01f);
}

TEST(FlyCamera, FliesAlongItsView) {
  FlyCamera fly;
  fly.stand({}, 90, 0);
  fly.fly({1, 2, 3});
  expect_near(fly.position(), {-3, 2, -1});
}

TEST(FlyCamera, DoesNotTumbleOver) {
  FlyCamera fly;
  fly.stand({}, 0, 0);
  fly.turn(0, 10);
  EXPECT_LT(fly.pitch_degrees(), 90);
  EXPECT_GT(fly.camera(1).up.y, 0);
  fly.turn(100, 0);
  EXPECT_LE(std::abs(fly.yaw_degrees()), 180);
}

}  // namespace
}  // namespace lightloom::view
