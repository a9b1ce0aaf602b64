#include "core/receivers/texel_opening.h"

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

#include "core/base/check.h"
#include "core/receivers/open_space.h"
#include "core/receivers/surface_point.h"

namespace lightloom {
namespace {

constexpr float kLongest = 1e6f;  // metres: no level has texels of this size

constexpr size_t kParts = kTexelParts * kTexelParts;
constexpr int kPlaceShift = 16;

/// Where in each part its point lies: the middle, or the middle of a quarter.
struct Place {
  float x, y;
};
constexpr std::array<Place, 5> kPlaces{{{0.5f, 0.5f}, {0.25f, 0.25f}, {0.75f, 0.25f}, {0.25f, 0.75f}, {0.75f, 0.75f}}};

/// The surface at the point of part i, pushed off, if the surface goes that far.
std::optional<ShadingPoint> part_point(const Object& object, const LightmapUv& uv, const TexelGrid& grid,
                                       const Texel& texel, bool back, size_t place, int i) {
  const auto at = [](int n, float within) { return (static_cast<float>(n) + within) / kTexelParts; };
  const auto p = surface_at(object, uv, grid, texel,
                            {at(i % kTexelParts, kPlaces[place].x), at(i / kTexelParts, kPlaces[place].y)});
  if (!p) return std::nullopt;
  return shading_point(object, p->triangle, p->b1, p->b2, back);
}

using Points = std::array<std::optional<ShadingPoint>, kParts>;

/// Of the parts that have a point.
struct OpenParts {
  uint32_t parts = 0;
  std::vector<ShadingPoint> points;
  size_t size = 0;    ///< parts; those that are not in the void count for more than all that are
  bool whole = true;  ///< there is none that does not count
};

/// The space that has most of them.
OpenParts find_open_parts(const RayTracer& tracer, const Points& points, uint64_t seed) {
  std::array<Space, kParts> what{};
  what.fill(Space::kSolid);
  const auto open = [&](size_t k) { return what[k] != Space::kSolid; };
  for (int i = 0; i < kTexelParts * kTexelParts; ++i) {
    const size_t k = static_cast<size_t>(i);
    if (!points[k]) continue;
    // What a straight line joins is the same space: most parts need no more than one ray.
    const auto seen_from = [&](int j) {
      const auto& other = points[static_cast<size_t>(j)];
      return other && tracer.visible(points[k]->position, other->position);
    };
    if (i % kTexelParts > 0 && seen_from(i - 1)) {
      what[k] = what[k - 1];
    } else if (i >= kTexelParts && seen_from(i - kTexelParts)) {
      what[k] = what[k - kTexelParts];
    } else {
      what[k] = classify(tracer, *points[k], hash_combine(seed, k));
    }
  }

  // Something may keep open parts apart, such as a door that is shut: the space that has most of them counts, but before
  // the void outside of a level any other.
  std::array<size_t, kParts> space{};  // of each part: the first one that it is joined with
  std::array<size_t, kParts> size{};   // of each space, parts; one that is not void counts for more than all that are
  for (size_t k = 0; k < kParts; ++k) {
    space[k] = k;
    if (!open(k)) continue;
    size[k] = what[k] == Space::kVoid ? 1 : kParts + 1;
    for (size_t j = k; j-- > 0;) {
      const size_t a = std::min(space[j], space[k]), b = std::max(space[j], space[k]);
      if (!open(j) || a == b || !joined(tracer, *points[j], *points[k])) continue;
      std::replace(space.begin(), space.begin() + static_cast<std::ptrdiff_t>(k) + 1, b, a);
      size[a] += std::exchange(size[b], 0);
    }
  }
  const size_t largest = static_cast<size_t>(std::max_element(size.begin(), size.end()) - size.begin());
  OpenParts out;
  out.size = size[largest];
  for (size_t k = 0; k < kParts; ++k) {
    if (!points[k]) continue;
    if (open(k) && space[k] == largest) {
      out.points.push_back(*points[k]);
      out.parts |= 1u << k;
    } else {
      out.whole = false;
    }
  }
  return out;
}

}  // namespace

std::vector<ShadingPoint> texel_points(const Object& object, const LightmapUv& uv, const TexelGrid& grid,
                                       const Texel& texel, bool back, uint32_t parts) {
  const size_t place = parts >> kPlaceShift;
  LL_CHECK(place < kPlaces.size());
  std::vector<ShadingPoint> out;
  for (int i = 0; i < kTexelParts * kTexelParts; ++i) {
    if (parts != 0 && (parts >> i & 1) == 0) continue;
    const auto point = part_point(object, uv, grid, texel, back, place, i);
    if (point) out.push_back(*point);
  }
  if (out.empty()) out.push_back(shading_point(object, texel.triangle, texel.b1, texel.b2, back));
  return out;
}

TexelOpening::TexelOpening(const RayTracer& tracer, const Object& object, const LightmapUv& uv, const TexelGrid& grid,
                           const Texel& texel, bool back, uint64_t seed)
    : tracer_(tracer), object_(object), uv_(uv), texel_(texel), back_(back) {
  if (!anything_stands_on_it()) return;
  const auto open_parts = [&](size_t place) {
    Points points;
    for (int i = 0; i < kTexelParts * kTexelParts; ++i) {
      points[static_cast<size_t>(i)] = part_point(object, uv, grid, texel, back, place, i);
    }
    return find_open_parts(tracer, points, place == 0 ? seed : hash_combine(seed, place));
  };
  OpenParts best = open_parts(0);
  whole_ = best.whole;
  if (whole_) return;
  // Where nothing is open at the middles, what can be seen of it may be a strip that is narrower than a part.
  size_t best_place = 0;
  if (best.parts == 0) {
    for (size_t place = 1; place < kPlaces.size(); ++place) {
      OpenParts other = open_parts(place);
      if (other.size <= best.size) continue;
      best = std::move(other);
      best_place = place;
    }
  }
  open_ = std::move(best.points);
  parts_ = best.parts | static_cast<uint32_t>(best_place << kPlaceShift);
  whole_ = best.parts == 0;
}

ShadingPoint TexelOpening::middle() const {
  if (whole_) return lifted({texel_.triangle, texel_.b1, texel_.b2});
  Vec3 mean;
  for (const ShadingPoint& p : open_) mean += p.position / static_cast<float>(open_.size());
  const auto distance2 = [&](const ShadingPoint& p) { return dot(p.position - mean, p.position - mean); };
  return *std::min_element(open_.begin(), open_.end(),
                           [&](const ShadingPoint& a, const ShadingPoint& b) { return distance2(a) < distance2(b); });
}

/// Segments along the texel's plane, just above it, meet whatever has its edge within the texel. They may also meet the
/// surface itself where it bends; then the parts decide.
bool TexelOpening::anything_stands_on_it() const {
  const Texel& texel = texel_;
  const auto& c = uv_.corners[texel.triangle];
  const auto& v = object_.triangles[texel.triangle].v;
  const Vec3 p0 = object_.positions[v[0]], e1 = object_.positions[v[1]] - p0, e2 = object_.positions[v[2]] - p0;
  const Vec2 d1 = c[1] - c[0], d2 = c[2] - c[0];
  const float det = d1.x * d2.y - d1.y * d2.x;
  if (det == 0) return false;
  const Vec3 across = (e1 * d2.y - e2 * d1.y) / det, up = (e2 * d1.x - e1 * d2.x) / det;  // ∂p/∂x, ∂p/∂y, per texel
  // A chart squeezed to almost nothing has texels without end: there, too, the parts decide.
  if (!(dot(across, across) + dot(up, up) < kLongest * kLongest)) return true;
  const ShadingPoint s = lifted({texel.triangle, texel.b1, texel.b2});
  const Vec2 point = c[0] + d1 * texel.b1 + d2 * texel.b2;
  const Vec3 corner =
      s.position + across * (static_cast<float>(texel.x) - point.x) + up * (static_cast<float>(texel.y) - point.y);
  for (int i = 0; i < kTexelParts; ++i) {
    const float at = (static_cast<float>(i) + 0.5f) / kTexelParts;
    // Not quite to the end: whether what stands on the border is met would be for the CPU to say.
    constexpr float kShort = 1 - 0x1p-12f;
    if (tracer_.occluded(corner + up * at, across, kShort) || tracer_.occluded(corner + across * at, up, kShort)) {
      return true;
    }
  }
  return false;
}

bool TexelOpening::contains(const SurfacePoint& point) const {
  if (whole_) return true;
  // It is open if nothing stands between it and a part that is, the nearest ones first.
  const Vec3 p = lifted(point).position;
  std::vector<Vec3> near;
  for (const ShadingPoint& q : open_) near.push_back(q.position);
  std::sort(near.begin(), near.end(), [&](Vec3 a, Vec3 b) { return dot(a - p, a - p) < dot(b - p, b - p); });
  constexpr size_t kTries = 4;
  near.resize(std::min(near.size(), kTries));
  return std::any_of(near.begin(), near.end(), [&](Vec3 q) { return tracer_.visible(p, q); });
}

}  // namespace lightloom
