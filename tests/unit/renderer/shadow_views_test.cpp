// Where shadow maps look, by projecting points with known places.
#include "runtime/renderer/shadow_views.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <vector>

namespace lightloom::renderer {
namespace {

constexpr uint32_t kSize = 512;

struct Projected {
  float x, y, z, w;
};
Projected project(const gpu::mat4& m, Vec3 p) {
  const auto row = [&](size_t r) { return m[r] * p.x + m[4 + r] * p.y + m[8 + r] * p.z + m[12 + r]; };
  const float w = row(3);
  return {row(0) / w, row(1) / w, row(2) / w, w};
}

Aabb box(Vec3 lo, Vec3 hi) {
  Aabb b;
  b.extend(lo);
  b.extend(hi);
  return b;
}

TEST(ShadowViews, CubeFacesAreInOrderAndNearerIsSmaller) {
  Light light;
  light.position = {1, 2, 3};
  const ShadowViews out = make_shadow_views({light}, box({-5, -5, -5}, {5, 5, 5}), kSize);
  ASSERT_EQ(out.views.size(), 6u);
  const std::array<Vec3, 6> axes{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
  for (size_t f = 0; f < 6; ++f) {
    EXPECT_EQ(out.views[f].layer, f);
    const Projected near = project(out.views[f].view_projection, light.position + axes[f] * 1);
    const Projected far = project(out.views[f].view_projection, light.position + axes[f] * 3);
    EXPECT_NEAR(near.x, 0, 1e-5) << f;
    EXPECT_NEAR(near.y, 0, 1e-5) << f;
    EXPECT_GT(near.z, 0) << f;
    EXPECT_LT(near.z, far.z) << f;
    EXPECT_LT(far.z, 1) << f;
    EXPECT_GT(near.w, 0) << f;
    EXPECT_LT(project(out.views[f].view_projection, light.position - axes[f]).w, 0) << f;
  }
}

TEST(ShadowViews, CubeFacesOverlapByAFewTexels) {
  Light light;
  const ShadowViews out = make_shadow_views({light}, box({-5, -5, -5}, {5, 5, 5}), kSize);
  const Projected edge = project(out.views[0].view_projection, {2, 2, 0});  // on the border of +X and +Y
  const float reach = std::max(std::abs(edge.x), std::abs(edge.y));
  const float texels_left = (1 - reach) / 2 * static_cast<float>(kSize);
  EXPECT_GE(texels_left, 3);  // a 4×4 filter fits
  EXPECT_LE(texels_left, 8);
}

TEST(ShadowViews, DirectionalBoxHoldsTheLevel) {
  Light light;
  light.type = LightType::kDirectional;
  light.direction = normalize(Vec3{0.3f, -1, 0.2f});
  const Vec3 lo{-30, -1, 4}, hi{12, 9, 40};
  const ShadowViews out = make_shadow_views({light}, box(lo, hi), kSize);
  ASSERT_EQ(out.views.size(), 1u);
  float last = 0;
  for (int corner = 0; corner < 8; ++corner) {
    const Vec3 p{corner & 1 ? hi.x : lo.x, corner & 2 ? hi.y : lo.y, corner & 4 ? hi.z : lo.z};
    const Projected at = project(out.views[0].view_projection, p);
    EXPECT_LT(std::max(std::abs(at.x), std::abs(at.y)), 1 - 4.0f / kSize);
    EXPECT_GT(at.z, 0);
    EXPECT_LT(at.z, 1);
    EXPECT_FLOAT_EQ(at.w, 1);
    last = at.z;
  }
  EXPECT_GT(project(out.views[0].view_projection, hi + light.direction).z, last);
  // One texel is as wide as the light's data says.
  const Projected a = project(out.views[0].view_projection, {0, 0, 10});
  Vec3 right, up;
  orthonormal_basis(light.direction, &right, &up);
  const Projected b = project(out.views[0].view_projection, Vec3{0, 0, 10} + right * out.lights[0].direction[3]);
  EXPECT_NEAR((b.x - a.x) / 2 * static_cast<float>(kSize), 1, 1e-3);
}

TEST(ShadowViews, SpotConeFillsItsMap) {
  Light light;
  light.type = LightType::kSpot;
  light.direction = {0, -1, 0};
  light.outer_cone_angle = 0.5f;
  light.inner_cone_angle = 0.2f;
  const ShadowViews out = make_shadow_views({light}, box({-5, -5, -5}, {5, 5, 5}), kSize);
  ASSERT_EQ(out.views.size(), 1u);
  const Projected edge = project(out.views[0].view_projection, {3 * std::tan(0.5f), -3, 0});
  const float reach = std::max(std::abs(edge.x), std::abs(edge.y));
  EXPECT_LT(reach, 1);
  EXPECT_GT(reach, 0.95f);
}

TEST(ShadowViews, CountsAndFirstViews) {
  Light point, sun;
  sun.type = LightType::kDirectional;
  const std::vector<Light> lights{sun, point, sun, point};
  EXPECT_EQ(shadow_view_count(lights), 14u);
  const ShadowViews out = make_shadow_views(lights, box({0, 0, 0}, {1, 1, 1}), kSize);
  ASSERT_EQ(out.lights.size(), 4u);
  EXPECT_EQ(out.views.size(), 14u);
  EXPECT_EQ(out.lights[0].first_view, 0u);
  EXPECT_EQ(out.lights[1].first_view, 1u);
  EXPECT_EQ(out.lights[2].first_view, 7u);
  EXPECT_EQ(out.lights[3].first_view, 8u);
}

}  // namespace
}  // namespace lightloom::renderer
