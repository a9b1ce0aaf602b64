#include "runtime/renderer/shadow_views.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace lightloom::renderer {
namespace {

constexpr float kNear = 0.01f;  // metres; what is closer to a lamp is taken as part of it
constexpr float kCameraNear = 0.005f;
constexpr float kGuard = 4;           // texels that each face of a cube looks past its edge
constexpr float kWidestSpot = 1.48f;  // radians; a wider cone gets shadows up to here

/// Rows of a matrix that takes world positions to clip space: row·(p, 1).
struct Row {
  Vec3 axis;
  double offset = 0;
};

double dot_double(Vec3 a, Vec3 b) {
  return static_cast<double>(a.x) * b.x + static_cast<double>(a.y) * b.y + static_cast<double>(a.z) * b.z;
}

/// scale · axis·(p − origin) + constant
Row row(Vec3 axis, Vec3 origin, double scale, double constant = 0) {
  return {axis * static_cast<float>(scale), constant - scale * dot_double(axis, origin)};
}

gpu::mat4 matrix(const Row& x, const Row& y, const Row& z, const Row& w) {
  gpu::mat4 m{};
  const std::array<const Row*, 4> rows{&x, &y, &z, &w};
  for (size_t r = 0; r < 4; ++r) {
    for (size_t c = 0; c < 3; ++c) m[4 * c + r] = rows[r]->axis[static_cast<int>(c)];
    m[12 + r] = static_cast<float>(rows[r]->offset);
  }
  return m;
}

/// Looks from `eye` along `forward` with half the opening's tangent `half`.
gpu::mat4 perspective(Vec3 eye, Vec3 forward, double half, double far) {
  Vec3 right, up;
  orthonormal_basis(forward, &right, &up);
  const double a = far / (far - kNear);
  return matrix(row(right, eye, 1 / half), row(up, eye, 1 / half), row(forward, eye, a, -a * kNear),
                row(forward, eye, 1));
}

float farthest(const Aabb& box, Vec3 from) {
  const Vec3 d{std::max(std::abs(box.lo.x - from.x), std::abs(box.hi.x - from.x)),
               std::max(std::abs(box.lo.y - from.y), std::abs(box.hi.y - from.y)),
               std::max(std::abs(box.lo.z - from.z), std::abs(box.hi.z - from.z))};
  return length(d) * 1.01f + 2 * kNear;
}

/// Sets the width of a texel too.
gpu::mat4 directional(const Aabb& box, Vec3 forward, uint32_t size, float* texel) {
  Vec3 right, up;
  orthonormal_basis(forward, &right, &up);
  const Vec3 centre = box.center(), half = box.size() * 0.5f;
  const auto reach = [&](Vec3 axis) {
    return std::abs(axis.x) * half.x + std::abs(axis.y) * half.y + std::abs(axis.z) * half.z;
  };
  const float widest = std::max({reach(right), reach(up), kNear});
  const float side = widest * static_cast<float>(size) / (static_cast<float>(size) - 2 * kGuard);
  const float deep = reach(forward) * 1.01f + kNear;
  *texel = 2 * side / static_cast<float>(size);
  return matrix(row(right, centre, 1 / static_cast<double>(side)), row(up, centre, 1 / static_cast<double>(side)),
                row(forward, centre, 0.5 / static_cast<double>(deep), 0.5), {{}, 1});
}

}  // namespace

uint32_t shadow_view_count(const std::vector<Light>& lights) {
  uint32_t n = 0;
  for (const Light& light : lights) n += light.type == LightType::kPoint ? 6 : 1;
  return n;
}

ShadowViews make_shadow_views(const std::vector<Light>& lights, const Aabb& bounds, uint32_t size) {
  static constexpr std::array<Vec3, 6> kFaces{{{1, 0, 0}, {-1, 0, 0}, {0, 1, 0}, {0, -1, 0}, {0, 0, 1}, {0, 0, -1}}};
  const float texels = static_cast<float>(size);
  ShadowViews out;
  const auto add_view = [&](const gpu::mat4& m) {
    out.views.push_back({m, static_cast<uint32_t>(out.views.size()), 0, 0, 0});
  };
  for (const Light& light : lights) {
    gpu::LightData data{};
    const Vec3 p = light.position, d = light.direction, c = light.color * light.intensity;
    data.position_range = {p.x, p.y, p.z, light.range};
    data.colour = {c.x, c.y, c.z, 0};
    data.type = static_cast<uint32_t>(light.type);
    data.first_view = static_cast<uint32_t>(out.views.size());
    float texel = 0;
    switch (light.type) {
      case LightType::kPoint: {
        const float half = texels / (texels - 2 * kGuard);
        texel = 2 * half / texels;
        for (const Vec3 face : kFaces) add_view(perspective(p, face, half, farthest(bounds, p)));
        break;
      }
      case LightType::kSpot: {
        const float cos_outer = std::cos(light.outer_cone_angle);
        data.cos_outer = cos_outer;
        data.cone_scale = 1.0f / std::max(0.001f, std::cos(light.inner_cone_angle) - cos_outer);
        const float half = std::tan(std::min(light.outer_cone_angle, kWidestSpot)) * texels / (texels - 2 * kGuard);
        texel = 2 * half / texels;
        add_view(perspective(p, d, half, farthest(bounds, p)));
        break;
      }
      case LightType::kDirectional:
        add_view(directional(bounds, d, size, &texel));
        break;
    }
    data.direction = {d.x, d.y, d.z, texel};
    out.lights.push_back(data);
  }
  return out;
}

gpu::mat4 camera_matrix(const Camera& camera) {
  const double half = std::tan(static_cast<double>(camera.yfov) / 2);
  return matrix(row(camera.right, camera.position, 1 / (half * camera.aspect)),
                row(camera.up, camera.position, -1 / half), {{}, kCameraNear}, row(camera.forward, camera.position, 1));
}

}  // namespace lightloom::renderer
