#include "core/receivers/texel_opening.h"

#include <algorithm>

#include "core/receivers/open_space.h"
#include "core/receivers/surface_point.h"

namespace lightloom {

TexelOpening::TexelOpening(const RayTracer& tracer, const Object& object, const LightmapUv& uv, const TexelGrid& grid,
                           const Texel& texel, bool back, uint64_t seed)
    : tracer_(tracer), object_(object), back_(back) {
  if (!anything_stands_on_it(uv, texel)) return;
  bool solid = false;
  for (int i = 0; i < kSide * kSide; ++i) {
    const auto at = [](int n) { return (static_cast<float>(n) + 0.5f) / kSide; };
    const auto p = surface_at(object, uv, grid, texel, {at(i % kSide), at(i / kSide)});
    if (!p) continue;
    const ShadingPoint s = shading_point(object, p->triangle, p->b1, p->b2, back);
    if (classify(tracer, s, hash_combine(seed, static_cast<uint64_t>(i))) == Space::kSolid) {
      solid = true;
    } else {
      centres_[static_cast<size_t>(open_++)] = s.position;
    }
  }
  whole_ = !solid || open_ == 0;
}

Vec3 TexelOpening::lifted(const SurfacePoint& p) const {
  return shading_point(object_, p.triangle, p.b1, p.b2, back_).position;
}

/// Segments along the texel's plane, just above it, meet whatever has its edge within the texel. They may also meet the
/// surface itself where it bends; then the parts decide.
bool TexelOpening::anything_stands_on_it(const LightmapUv& uv, const Texel& texel) const {
  const auto& c = uv.corners[texel.triangle];
  const auto& v = object_.triangles[texel.triangle].v;
  const Vec3 p0 = object_.positions[v[0]], e1 = object_.positions[v[1]] - p0, e2 = object_.positions[v[2]] - p0;
  const Vec2 d1 = c[1] - c[0], d2 = c[2] - c[0];
  const float det = d1.x * d2.y - d1.y * d2.x;
  if (det == 0) return false;
  const Vec3 across = (e1 * d2.y - e2 * d1.y) / det, up = (e2 * d1.x - e1 * d2.x) / det;  // ∂p/∂x, ∂p/∂y, per texel
  const ShadingPoint s = shading_point(object_, texel.triangle, texel.b1, texel.b2, back_);
  const Vec2 point = c[0] + d1 * texel.b1 + d2 * texel.b2;
  const Vec3 corner =
      s.position + across * (static_cast<float>(texel.x) - point.x) + up * (static_cast<float>(texel.y) - point.y);
  for (int i = 0; i < kSide; ++i) {
    const float at = (static_cast<float>(i) + 0.5f) / kSide;
    if (tracer_.occluded(corner + up * at, across, 1) || tracer_.occluded(corner + across * at, up, 1)) return true;
  }
  return false;
}

bool TexelOpening::contains(const SurfacePoint& point) const {
  if (whole_) return true;
  // It is open if nothing stands between it and a part that is, the nearest ones first.
  const Vec3 p = lifted(point);
  std::array<Vec3, kSide* kSide> near = centres_;
  std::sort(near.begin(), near.begin() + open_, [&](Vec3 a, Vec3 b) { return dot(a - p, a - p) < dot(b - p, b - p); });
  constexpr int kTries = 4;
  return std::any_of(near.begin(), near.begin() + std::min(open_, kTries),
                     [&](Vec3 q) { return tracer_.visible(p, q); });
}

}  // namespace lightloom
