#include "core/receivers/texels.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>

namespace lightloom {
namespace {

struct Point {
  double x, y;
};

/// Convex polygon. A triangle clipped by a square has at most 7 corners; the rest is room for rounding.
struct Polygon {
  std::array<Point, 16> p;
  int n = 0;
};

/// Keeps the part where sign·(p[axis] − bound) ≥ 0 (Sutherland & Hodgman 1974).
Polygon clip(const Polygon& in, int axis, double bound, double sign) {
  Polygon out;
  for (int i = 0; i < in.n; ++i) {
    const Point a = in.p[static_cast<size_t>(i)], b = in.p[static_cast<size_t>((i + 1) % in.n)];
    const double da = sign * ((axis == 0 ? a.x : a.y) - bound), db = sign * ((axis == 0 ? b.x : b.y) - bound);
    if (da >= 0) out.p[static_cast<size_t>(out.n++)] = a;
    if ((da >= 0) != (db >= 0)) {
      const double t = da / (da - db);
      out.p[static_cast<size_t>(out.n++)] = {a.x + (b.x - a.x) * t, a.y + (b.y - a.y) * t};
    }
  }
  return out;
}

/// Twice the signed area.
double cross(Point a, Point b, Point c) { return (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x); }

double area(const Polygon& p) {
  double sum = 0;
  for (int i = 1; i + 1 < p.n; ++i) sum += cross(p.p[0], p.p[static_cast<size_t>(i)], p.p[static_cast<size_t>(i + 1)]);
  return std::abs(sum) / 2;
}

Point centroid(const Polygon& p) {
  double x = 0, y = 0, weight = 0;
  for (int i = 1; i + 1 < p.n; ++i) {
    const Point a = p.p[0], b = p.p[static_cast<size_t>(i)], c = p.p[static_cast<size_t>(i + 1)];
    const double w = std::abs(cross(a, b, c));
    x += w * (a.x + b.x + c.x) / 3;
    y += w * (a.y + b.y + c.y) / 3;
    weight += w;
  }
  return {x / weight, y / weight};
}

/// Barycentric weights of the second and third corner; false outside the triangle or if it is flat in uv.
bool barycentric(const std::array<Vec2, 3>& c, Point p, double tolerance, float* b1, float* b2) {
  const Point p0{c[0].x, c[0].y}, p1{c[1].x, c[1].y}, p2{c[2].x, c[2].y};
  const double det = cross(p0, p1, p2);
  if (det == 0) return false;
  const double u = cross(p0, p, p2) / det, v = cross(p0, p1, p) / det;
  if (u < -tolerance || v < -tolerance || u + v > 1 + tolerance) return false;
  const double cu = std::clamp(u, 0.0, 1.0), cv = std::clamp(v, 0.0, 1.0);
  const double scale = cu + cv > 1 ? 1 / (cu + cv) : 1;
  *b1 = static_cast<float>(cu * scale);
  *b2 = static_cast<float>(cv * scale);
  return true;
}

struct Candidate {
  uint64_t texel;  // y·width + x
  uint32_t triangle;
  float uv_area;  // texels²
  bool centre;
  float b1, b2;  // of the centre, or of the fragment's centroid
};

double world_area(const Object& object, uint32_t triangle) {
  const auto& v = object.triangles[triangle].v;
  return length(lightloom::cross(object.positions[v[1]] - object.positions[v[0]],
                                 object.positions[v[2]] - object.positions[v[0]])) /
         2;
}

/// All texels that a triangle touches, with the clipped area in each.
void rasterise_triangle(const LightmapUv& uv, uint32_t triangle, std::vector<Candidate>* out) {
  const auto& c = uv.corners[triangle];
  const double lo_x = std::min({c[0].x, c[1].x, c[2].x}), hi_x = std::max({c[0].x, c[1].x, c[2].x});
  const double lo_y = std::min({c[0].y, c[1].y, c[2].y}), hi_y = std::max({c[0].y, c[1].y, c[2].y});
  const int x0 = std::clamp(static_cast<int>(std::floor(lo_x)), 0, uv.width - 1);
  const int y0 = std::clamp(static_cast<int>(std::floor(lo_y)), 0, uv.height - 1);
  const int x1 = std::clamp(static_cast<int>(std::floor(hi_x)), 0, uv.width - 1);
  const int y1 = std::clamp(static_cast<int>(std::floor(hi_y)), 0, uv.height - 1);
  const auto key = [&](int x, int y) {
    return static_cast<uint64_t>(y) * static_cast<uint64_t>(uv.width) + static_cast<uint64_t>(x);
  };

  Polygon whole;
  whole.n = 3;
  for (size_t i = 0; i < 3; ++i) whole.p[i] = {c[i].x, c[i].y};
  bool any = false;
  for (int y = y0; y <= y1; ++y) {
    const Polygon row = clip(clip(whole, 1, y, 1), 1, y + 1, -1);
    if (row.n < 3) continue;
    for (int x = x0; x <= x1; ++x) {
      const Polygon part = clip(clip(row, 0, x, 1), 0, x + 1, -1);
      const double a = part.n < 3 ? 0 : area(part);
      if (!(a > 1e-9)) continue;
      Candidate k{key(x, y), triangle, static_cast<float>(a), false, 0, 0};
      k.centre = barycentric(c, {x + 0.5, y + 0.5}, 1e-9, &k.b1, &k.b2);
      if (!k.centre) barycentric(c, centroid(part), 1e9, &k.b1, &k.b2);
      out->push_back(k);
      any = true;
    }
  }
  // A triangle without extent in uv still owns the texel it lies in.
  if (!any) out->push_back({key(x0, y0), triangle, 0, false, 1.0f / 3, 1.0f / 3});
}

}  // namespace

float texel_size(const Object& object, const LightmapUv& uv, uint32_t triangle) {
  const auto& c = uv.corners[triangle];
  const double uv_area = std::abs(cross({c[0].x, c[0].y}, {c[1].x, c[1].y}, {c[2].x, c[2].y})) / 2;
  return uv_area > 0 ? static_cast<float>(std::sqrt(world_area(object, triangle) / uv_area)) : 0;
}

Vec3 geometric_normal(const Object& object, uint32_t triangle) {
  const auto& v = object.triangles[triangle].v;
  return normalize(
      cross(object.positions[v[1]] - object.positions[v[0]], object.positions[v[2]] - object.positions[v[0]]));
}

TexelGrid rasterise(const Object& object, const LightmapUv& uv) {
  TexelGrid grid;
  grid.width = uv.width;
  grid.height = uv.height;
  std::vector<Candidate> candidates;
  std::vector<double> scale(object.triangles.size());  // m² per texel²
  for (uint32_t t = 0; t < object.triangles.size(); ++t) {
    const size_t first = candidates.size();
    rasterise_triangle(uv, t, &candidates);
    double uv_area = 0;
    for (size_t i = first; i < candidates.size(); ++i) uv_area += candidates[i].uv_area;
    scale[t] = uv_area > 0 ? world_area(object, t) / uv_area : 0;
  }
  std::stable_sort(candidates.begin(), candidates.end(),
                   [](const Candidate& a, const Candidate& b) { return a.texel < b.texel; });

  // A triangle whose texels are all below the coverage limit keeps its largest one.
  constexpr float kMinCoverage = 1.0f / 16;
  const auto run_end = [&](size_t i) {
    size_t j = i;
    while (j < candidates.size() && candidates[j].texel == candidates[i].texel) ++j;
    return j;
  };
  std::vector<bool> has_texel(object.triangles.size(), false);
  std::vector<bool> keep(candidates.size(), false);
  std::vector<size_t> best(object.triangles.size(), candidates.size());
  for (size_t i = 0; i < candidates.size(); i = run_end(i)) {
    float coverage = 0;
    bool centre = false;
    const size_t end = run_end(i);
    for (size_t j = i; j < end; ++j) coverage += candidates[j].uv_area, centre |= candidates[j].centre;
    const bool kept = centre || coverage >= kMinCoverage;
    for (size_t j = i; j < end; ++j) {
      const uint32_t t = candidates[j].triangle;
      if (kept) keep[j] = has_texel[t] = true;
      if (best[t] == candidates.size() || candidates[j].uv_area > candidates[best[t]].uv_area) best[t] = j;
    }
  }
  for (uint32_t t = 0; t < has_texel.size(); ++t) {
    if (!has_texel[t]) keep[best[t]] = true;
  }

  for (size_t i = 0; i < candidates.size(); i = run_end(i)) {
    const size_t end = run_end(i);
    bool kept = false;
    const Candidate* point = nullptr;
    for (size_t j = i; j < end; ++j) {
      kept |= keep[j];
      const Candidate& c = candidates[j];
      // The centre's triangle, else the largest fragment's.
      if (!point || (c.centre && !point->centre) ||
          (c.centre == point->centre && !c.centre && c.uv_area > point->uv_area)) {
        point = &c;
      }
    }
    if (!kept) continue;
    Texel texel;
    texel.x = static_cast<uint32_t>(candidates[i].texel % static_cast<uint64_t>(uv.width));
    texel.y = static_cast<uint32_t>(candidates[i].texel / static_cast<uint64_t>(uv.width));
    texel.triangle = point->triangle;
    texel.b1 = point->b1;
    texel.b2 = point->b2;
    texel.centre_covered = point->centre;
    texel.first_fragment = static_cast<uint32_t>(grid.fragments.size());
    for (size_t j = i; j < end; ++j) {
      const Candidate& c = candidates[j];
      grid.fragments.push_back({c.triangle, static_cast<float>(c.uv_area * scale[c.triangle])});
      texel.area += grid.fragments.back().area;
    }
    texel.fragments = static_cast<uint32_t>(grid.fragments.size()) - texel.first_fragment;
    grid.texels.push_back(texel);
  }
  return grid;
}

namespace {

Vec3 position(const Object& object, const SurfacePoint& s) {
  return interpolate(object.positions, object.triangles[s.triangle], s.b1, s.b2);
}

/// Cycles 3.4 jitters by uv differentials that Blender computes at half their size, and folds what leaves the triangle
/// back by its first two barycentrics (bake_differentials in bake.c, bake_clamp_mirror_repeat in init_from_bake.h).
SurfacePoint sample_as_cycles(const LightmapUv& uv, const Texel& texel, Sample2 jitter) {
  const auto& c = uv.corners[texel.triangle];
  const Point p{texel.x + 0.25 + jitter.u / 2, texel.y + 0.25 + jitter.v / 2};
  const Point p0{c[0].x, c[0].y}, p1{c[1].x, c[1].y}, p2{c[2].x, c[2].y};
  const double det = cross(p0, p1, p2);
  if (det == 0) return {texel.triangle, texel.b1, texel.b2};
  const auto fold = [](double u, double limit) {
    if (!(limit > 0)) return 0.0;
    u /= limit;
    const double whole = std::floor(u);
    u -= whole;
    return (std::fmod(whole, 2) != 0 ? 1 - u : u) * limit;
  };
  const double u = fold(cross(p, p1, p2) / det, 1);
  const double v = fold(cross(p0, p, p2) / det, 1 - u);
  return {texel.triangle, static_cast<float>(v), static_cast<float>(std::max(0.0, 1 - u - v))};
}

}  // namespace

std::optional<SurfacePoint> surface_at(const Object& object, const LightmapUv& uv, const TexelGrid& grid,
                                       const Texel& texel, Sample2 at) {
  const Point p{texel.x + static_cast<double>(at.u), texel.y + static_cast<double>(at.v)};
  for (uint32_t f = 0; f < texel.fragments; ++f) {
    const uint32_t t = grid.fragments[texel.first_fragment + f].triangle;
    SurfacePoint s{t, 0, 0};
    if (!barycentric(uv.corners[t], p, 0, &s.b1, &s.b2)) continue;
    if (t == texel.triangle) return s;
    // What continues the surface lies within the texel's diagonal and faces alike.
    const float reach = 1.5f * texel_size(object, uv, texel.triangle);
    const Vec3 centre = position(object, {texel.triangle, texel.b1, texel.b2});
    if (dot(geometric_normal(object, t), geometric_normal(object, texel.triangle)) >= 0.7071f &&
        length(position(object, s) - centre) <= reach) {
      return s;
    }
  }
  return std::nullopt;
}

SurfacePoint sample_texel(const Object& object, const LightmapUv& uv, const TexelGrid& grid, const Texel& texel,
                          Sample2 jitter, Footprint footprint, const std::function<bool(const SurfacePoint&)>& accept) {
  if (footprint == Footprint::kCycles) return sample_as_cycles(uv, texel, jitter);
  // Rejection over the texel's square. The first, and mostly only, point keeps the caller's stratification; the others
  // are random numbers that the jitter names: steps of fixed length would favour some of the surface.
  constexpr int kAttempts = 64;  // a texel that is kept is covered by 1/16 or more
  Rng rng(static_cast<uint64_t>(std::bit_cast<uint32_t>(jitter.u)) << 32 | std::bit_cast<uint32_t>(jitter.v));
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const auto s = surface_at(object, uv, grid, texel, jitter);
    if (s && (!accept || accept(*s))) return *s;
    jitter.u = rng.next_float();
    jitter.v = rng.next_float();
  }
  return {texel.triangle, texel.b1, texel.b2};
}

}  // namespace lightloom
