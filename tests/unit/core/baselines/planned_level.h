// A level that is planned, not baked: what baselines light.
#pragma once

#include <cmath>
#include <memory>
#include <vector>

#include "core/baselines/baseline.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom::test {

struct PlannedLevel {
  PlannedLevel(Scene s, float spacing, float texels_per_metre = 4, int relight_rays = 1024) : scene(std::move(s)) {
    tracer = value_or_die(RayTracer::create(scene));
    BakeParams params;
    params.spacing = spacing;
    params.texels_per_metre = texels_per_metre;
    params.relight_rays = relight_rays;
    plan = value_or_die(make_plan(*tracer, params, {}));
    inputs = value_or_die(light_surfaces(*tracer, {plan.layout, plan.receivers}, 4, {}));
  }
  std::vector<Vec3> light(const Baseline& baseline, int frames, int threads = 0) const {
    Parallel how;
    how.threads = threads;
    return baseline.light(inputs, scene.environment, frames, how);
  }

  Scene scene;
  std::unique_ptr<RayTracer> tracer;
  Plan plan;
  SurfaceInputs inputs;
};

/// The inside of a 2 m cube, all black, whose east wall (x = 2) emits radiance 1.
inline Scene east_lit_cube() {
  std::array<Wall, 6> walls;
  walls.fill({{0, 0, 0}, {}});
  walls[3].emission = {1, 1, 1};
  return closed_box({2, 2, 2}, walls);
}
/// E at a point in that cube, of a normal along an axis, by Lambert's formula: half the sum over the edges of the part of
/// the wall above the horizon of angle · (edge's normal · n).
inline float irradiance_in_east_lit_cube(Vec3 p, Vec3 n) {
  if (n.x < -0.5f) return 0;
  float lo[3] = {2, 0, 0}, hi[3] = {2, 2, 2};
  for (int a = 1; a < 3; ++a) (n[a] > 0.5f ? lo : hi)[a] = std::abs(n[a]) > 0.5f ? p[a] : n[a] > 0.5f ? lo[a] : hi[a];
  const Vec3 corners[4] = {{2, lo[1], lo[2]}, {2, hi[1], lo[2]}, {2, hi[1], hi[2]}, {2, lo[1], hi[2]}};
  float sum = 0;
  for (int i = 0; i < 4; ++i) {
    const Vec3 a = normalize(corners[i] - p), b = normalize(corners[(i + 1) % 4] - p);
    sum += std::acos(dot(a, b)) * dot(normalize(cross(a, b)), n);
  }
  return std::abs(sum) / 2;
}

}  // namespace lightloom::test
