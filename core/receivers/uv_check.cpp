#include "core/receivers/uv_check.h"

#include <algorithm>
#include <cmath>

#include "core/receivers/texel_raster.h"

namespace lightloom {
namespace {

constexpr float kRounding = 1e-4f;                   // how far outside [0,1] a coordinate may lie
constexpr uint64_t kPaintLimit = uint64_t{1} << 31;  // texels and rows, before the count is given up
constexpr uint64_t kForgiven = 1000;
constexpr uint32_t kShared = 0xffffffffu;

}  // namespace

bool has_unit_uv1(const Object& object) {
  if (object.uv1.empty() || object.uv1.size() != object.positions.size()) return false;
  const auto inside = [](float c) { return c >= -kRounding && c <= 1 + kRounding; };
  return std::all_of(object.uv1.begin(), object.uv1.end(), [&](Vec2 p) { return inside(p.x) && inside(p.y); });
}

LightmapUv scaled_uv1(const Object& object, int width, int height) {
  LightmapUv uv{width, height, std::vector<std::array<Vec2, 3>>(object.triangles.size())};
  const auto scaled = [](float c, int size) { return std::clamp(c, 0.0f, 1.0f) * static_cast<float>(size); };
  for (size_t t = 0; t < uv.corners.size(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      const Vec2 p = object.uv1[object.triangles[t].v[k]];
      uv.corners[t][k] = {scaled(p.x, width), scaled(p.y, height)};
    }
  }
  return uv;
}

double uv1_area(const Object& object) {
  double area = 0;
  for (const Triangle& t : object.triangles) {
    const Vec2 a = object.uv1[t.v[0]], b = object.uv1[t.v[1]], c = object.uv1[t.v[2]];
    area += 0.5 * std::abs((double{b.x} - a.x) * (double{c.y} - a.y) - (double{b.y} - a.y) * (double{c.x} - a.x));
  }
  return area;
}

TexelClaims::TexelClaims(int width, int height)
    : width_(width), height_(height), owner_(static_cast<size_t>(width) * static_cast<size_t>(height), 0) {}

void TexelClaims::claim(const LightmapUv& uv, uint32_t owner) {
  for (const auto& corners : uv.corners) paint(corners, owner + 1);
}

void TexelClaims::claim_each(const LightmapUv& uv) {
  for (uint32_t t = 0; t < uv.corners.size(); ++t) paint(uv.corners[t], t + 1);
}

bool TexelClaims::disjoint() const { return painted_ <= kPaintLimit && shared_ * kForgiven <= covered_; }

void TexelClaims::paint(const std::array<Vec2, 3>& corners, uint32_t owner) {
  GridTriangle triangle;
  for (size_t k = 0; k < 3; ++k) {
    triangle[k] = {static_cast<int32_t>(std::floor(corners[k].x * kGrid + 0.5f)),
                   static_cast<int32_t>(std::floor(corners[k].y * kGrid + 0.5f))};
  }
  if (painted_ > kPaintLimit) return;
  const auto [low, high] = std::minmax({triangle[0].y, triangle[1].y, triangle[2].y});
  painted_ += static_cast<uint64_t>((high - low) / kGrid);
  rasterise(triangle, {}, 0, [&](int y, int first, int last) {
    painted_ += static_cast<uint64_t>(last - first + 1);
    for (int x = first; x <= last; ++x) {
      uint32_t& claimed = owner_[static_cast<size_t>(y) * static_cast<size_t>(width_) + static_cast<size_t>(x)];
      if (claimed == 0) {
        claimed = owner;
        ++covered_;
      } else if (claimed != owner && claimed != kShared) {
        claimed = kShared;
        ++shared_;
      }
    }
    return true;
  });
}

}  // namespace lightloom
