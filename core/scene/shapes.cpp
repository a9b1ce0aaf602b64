#include "core/scene/shapes.h"

#include <algorithm>
#include <array>
#include <map>
#include <utility>

#include "core/base/check.h"

namespace lightloom {
namespace {

uint32_t add_vertex(Object* object, Vec3 position, Vec3 normal) {
  object->positions.push_back(position);
  object->normals.push_back(normal);
  return static_cast<uint32_t>(object->positions.size() - 1);
}

/// The point whose coordinate along `thin` is t, and along the wall u; v is the height.
Vec3 on_wall(int thin, float t, float u, float v) { return thin == 0 ? Vec3{t, v, u} : Vec3{u, v, t}; }

std::vector<float> cuts(float lo, float hi, std::vector<float> inner) {
  std::vector<float> out{lo};
  std::sort(inner.begin(), inner.end());
  for (const float c : inner) {
    if (c > out.back() && c < hi) out.push_back(c);
  }
  out.push_back(hi);
  return out;
}

}  // namespace

void add_triangle(Object* object, Vec3 a, Vec3 b, Vec3 c, uint32_t material) {
  const Vec3 n = normalize(cross(b - a, c - a));
  Triangle t;
  t.v = {add_vertex(object, a, n), add_vertex(object, b, n), add_vertex(object, c, n)};
  t.material = material;
  object->triangles.push_back(t);
}

void add_quad(Object* object, Vec3 a, Vec3 b, Vec3 c, Vec3 d, uint32_t material) {
  const Vec3 n = normalize(cross(c - a, d - b));
  const uint32_t v0 = add_vertex(object, a, n), v1 = add_vertex(object, b, n), v2 = add_vertex(object, c, n),
                 v3 = add_vertex(object, d, n);
  object->triangles.push_back({{v0, v1, v2}, material});
  object->triangles.push_back({{v0, v2, v3}, material});
}

void add_box(Object* object, Vec3 lo, Vec3 hi, uint32_t material) {
  add_wall(object, lo, hi, 2, {}, material, material);
}

void add_wall(Object* object, Vec3 lo, Vec3 hi, int thin, const std::vector<Opening>& openings, uint32_t negative,
              uint32_t positive) {
  LL_CHECK(thin == 0 || thin == 2);
  const int along = 2 - thin;
  std::vector<float> inner_u, inner_v;
  for (const Opening& o : openings) {
    inner_u.insert(inner_u.end(), {o.from, o.to});
    inner_v.insert(inner_v.end(), {o.bottom, o.top});
  }
  const std::vector<float> us = cuts(lo[along], hi[along], inner_u), vs = cuts(lo.y, hi.y, inner_v);
  const int nu = static_cast<int>(us.size()) - 1, nv = static_cast<int>(vs.size()) - 1;
  const auto u_at = [&](int i) { return us[static_cast<size_t>(i)]; };
  const auto v_at = [&](int i) { return vs[static_cast<size_t>(i)]; };
  const auto solid = [&](int i, int j) {
    if (i < 0 || j < 0 || i >= nu || j >= nv) return false;
    const float u = (u_at(i) + u_at(i + 1)) / 2, v = (v_at(j) + v_at(j + 1)) / 2;
    return std::none_of(openings.begin(), openings.end(),
                        [&](const Opening& o) { return u > o.from && u < o.to && v > o.bottom && v < o.top; });
  };
  const float t0 = lo[thin], t1 = hi[thin];
  // Quads are given as seen for a wall thin in z; one thin in x is its mirror image, so turns them over.
  const auto quad = [&](Vec3 a, Vec3 b, Vec3 c, Vec3 d, uint32_t material) {
    thin == 2 ? add_quad(object, a, b, c, d, material) : add_quad(object, d, c, b, a, material);
  };
  const auto at = [&](float t, float u, float v) { return on_wall(thin, t, u, v); };
  for (int j = 0; j < nv; ++j) {
    for (int i = 0; i < nu; ++i) {
      if (!solid(i, j)) continue;
      const float u0 = u_at(i), u1 = u_at(i + 1), v0 = v_at(j), v1 = v_at(j + 1);
      quad(at(t1, u0, v0), at(t1, u1, v0), at(t1, u1, v1), at(t1, u0, v1), positive);
      quad(at(t0, u1, v0), at(t0, u0, v0), at(t0, u0, v1), at(t0, u1, v1), negative);
      if (!solid(i - 1, j)) quad(at(t0, u0, v0), at(t1, u0, v0), at(t1, u0, v1), at(t0, u0, v1), positive);
      if (!solid(i + 1, j)) quad(at(t1, u1, v0), at(t0, u1, v0), at(t0, u1, v1), at(t1, u1, v1), positive);
      if (!solid(i, j - 1)) quad(at(t0, u0, v0), at(t0, u1, v0), at(t1, u1, v0), at(t1, u0, v0), positive);
      if (!solid(i, j + 1)) quad(at(t1, u0, v1), at(t1, u1, v1), at(t0, u1, v1), at(t0, u0, v1), positive);
    }
  }
}

std::vector<Vec2> circle(int n) {
  LL_CHECK(n >= 4 && (n & (n - 1)) == 0);
  std::vector<Vec2> points{{1, 0}, {0, 1}, {-1, 0}, {0, -1}};
  while (static_cast<int>(points.size()) < n) {
    std::vector<Vec2> finer;
    for (size_t i = 0; i < points.size(); ++i) {
      const Vec2 middle = points[i] + points[(i + 1) % points.size()];
      finer.push_back(points[i]);
      finer.push_back(middle * (1 / std::sqrt(middle.x * middle.x + middle.y * middle.y)));
    }
    points = std::move(finer);
  }
  return points;
}

void add_lathe(Object* object, const Lathe& lathe, uint32_t material) {
  const std::vector<Vec2> ring = circle(lathe.segments);
  const auto n = static_cast<uint32_t>(lathe.segments);
  const auto base = static_cast<uint32_t>(object->positions.size());
  // A groove's section, a half circle, at the steps of one flute.
  const auto depth = [&](uint32_t segment) {
    if (lathe.flutes == 0) return 0.0f;
    const uint32_t steps = n / static_cast<uint32_t>(lathe.flutes);
    const float s = 2 * static_cast<float>(segment % steps) / static_cast<float>(steps) - 1;
    return lathe.flute_depth * std::sqrt(1 - s * s);
  };

  // Vertices: a ring for each point of the profile, a single one on the axis.
  std::vector<uint32_t> first;
  for (const Lathe::Point& p : lathe.profile) {
    first.push_back(static_cast<uint32_t>(object->positions.size()));
    for (uint32_t j = 0; j < (p.radius > 0 ? n : 1); ++j) {
      const float r = p.radius * (p.fluted ? 1 - depth(j) : 1.0f);
      // (sin, height, cos): right-handed around the axis, whichever it is.
      const std::array<float, 3> local{r * ring[j].y, p.height, r * ring[j].x};
      Vec3 position = lathe.center;
      for (int c = 0; c < 3; ++c) position[(c + lathe.axis + 2) % 3] += local[static_cast<size_t>(c)];
      add_vertex(object, position, {});
    }
  }

  // Faces, skipping those that creases and poles leave without area.
  const size_t begin = object->triangles.size();
  const size_t bands = lathe.loop ? lathe.profile.size() : lathe.profile.size() - 1;
  for (size_t i = 0; i < bands; ++i) {
    const size_t k = (i + 1) % lathe.profile.size();
    const Lathe::Point &p = lathe.profile[i], &q = lathe.profile[k];
    if (p.radius == q.radius && p.height == q.height) continue;
    for (uint32_t j = 0; j < n; ++j) {
      const auto vertex = [&](size_t point, uint32_t segment) {
        return first[point] + (lathe.profile[point].radius > 0 ? segment % n : 0);
      };
      const uint32_t a = vertex(i, j), b = vertex(i, j + 1), c = vertex(k, j + 1), d = vertex(k, j);
      if (a != b) object->triangles.push_back({{a, b, c}, material});
      if (c != d) object->triangles.push_back({{a, c, d}, material});
    }
  }

  // Smooth normals: the faces around each vertex, weighted by area.
  for (size_t t = begin; t < object->triangles.size(); ++t) {
    const auto& v = object->triangles[t].v;
    const Vec3 p = object->positions[v[0]];
    const Vec3 normal = cross(object->positions[v[1]] - p, object->positions[v[2]] - p);
    for (const uint32_t i : v) object->normals[i] += normal;
  }
  for (size_t v = base; v < object->normals.size(); ++v) object->normals[v] = normalize(object->normals[v]);
}

void add_sphere(Object* object, Vec3 center, float radius, int segments, uint32_t material) {
  Lathe lathe;
  lathe.center = center;
  lathe.segments = segments;
  const std::vector<Vec2> points = circle(segments);
  const size_t quarter = points.size() / 4;
  for (size_t i = 0; i <= 2 * quarter; ++i) {  // from -90° to 90°
    const Vec2 p = points[(3 * quarter + i) % points.size()] * radius;
    lathe.profile.push_back({i == 0 || i == 2 * quarter ? 0 : p.x, p.y, false});
  }
  add_lathe(object, lathe, material);
}

void add_torus(Object* object, Vec3 center, int axis, float radius, float tube, int segments, uint32_t material) {
  Lathe lathe;
  lathe.center = center;
  lathe.axis = axis;
  lathe.segments = segments;
  lathe.loop = true;
  for (const Vec2 p : circle(segments / 2)) lathe.profile.push_back({radius + tube * p.x, tube * p.y, false});
  add_lathe(object, lathe, material);
}

void subdivide(Object* o) {
  std::map<std::pair<uint32_t, uint32_t>, uint32_t> middles;
  const auto middle = [&](uint32_t a, uint32_t b) {
    const auto [it, fresh] = middles.try_emplace(std::minmax(a, b), static_cast<uint32_t>(o->positions.size()));
    if (fresh) {
      o->positions.push_back((o->positions[a] + o->positions[b]) * 0.5f);
      o->normals.push_back(normalize(o->normals[a] + o->normals[b]));
      for (std::vector<Vec2>* uv : {&o->uv0, &o->uv1}) {
        if (uv->empty()) continue;
        const Vec2 p = (*uv)[a], q = (*uv)[b];
        uv->push_back({(p.x + q.x) * 0.5f, (p.y + q.y) * 0.5f});
      }
    }
    return it->second;
  };
  std::vector<Triangle> quarters;
  for (const Triangle& t : o->triangles) {
    const auto [a, b, c] = t.v;
    const uint32_t ab = middle(a, b), bc = middle(b, c), ca = middle(c, a);
    for (const std::array<uint32_t, 3> v : {std::array{a, ab, ca}, {ab, b, bc}, {ca, bc, c}, {ab, bc, ca}}) {
      quarters.push_back(t);
      quarters.back().v = v;
    }
  }
  o->triangles = std::move(quarters);
}

}  // namespace lightloom
