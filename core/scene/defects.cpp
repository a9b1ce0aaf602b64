#include "core/scene/defects.h"

#include <nanoflann.hpp>

#include <algorithm>
#include <array>
#include <limits>
#include <map>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

namespace lightloom {
namespace {

constexpr float kTouching = 1e-5f;   // metres
constexpr float kNear = 0.02f;       // metres
constexpr float kNearShare = 0.05f;  // of an edge's length

using Corners = std::array<uint32_t, 3>;

/// All static triangles, their corners numbered by position.
struct Welded {
  std::vector<Vec3> positions;
  std::vector<Corners> triangles;
};

Welded weld(const Scene& scene) {
  Welded out;
  std::map<std::array<float, 3>, uint32_t> number;
  for (const Object& object : scene.objects) {
    if (!object.is_static) continue;
    std::vector<uint32_t> of_vertex;
    for (const Vec3 p : object.positions) {
      // −0 and 0 are one place.
      const auto [it, fresh] =
          number.try_emplace({p.x + 0.0f, p.y + 0.0f, p.z + 0.0f}, static_cast<uint32_t>(out.positions.size()));
      if (fresh) out.positions.push_back(p);
      of_vertex.push_back(it->second);
    }
    for (const Triangle& t : object.triangles) {
      out.triangles.push_back({of_vertex[t.v[0]], of_vertex[t.v[1]], of_vertex[t.v[2]]});
    }
  }
  return out;
}

struct Edge {
  uint32_t a, b;
};

/// Corners of the border, as nanoflann reads them.
struct Border {
  std::vector<Vec3> points;
  std::vector<uint32_t> corner;
  size_t kdtree_get_point_count() const { return points.size(); }
  float kdtree_get_pt(size_t i, size_t axis) const { return points[i][static_cast<int>(axis)]; }
  template <class Box>
  bool kdtree_get_bbox(Box&) const {
    return false;
  }
};

/// Distance of p from the line through a and b; infinite if p lies beyond either.
float distance_beside(Vec3 p, Vec3 a, Vec3 b) {
  constexpr float kSlack = 1e-3f;
  const Vec3 d = b - a;
  const float t = dot(p - a, d) / dot(d, d);
  if (t < -kSlack || t > 1 + kSlack) return std::numeric_limits<float>::infinity();
  return length(p - (a + d * t));
}

/// What corners of the border lie on, or pass by, its edges.
void look_along(const Welded& mesh, const std::vector<Edge>& open, Defects* defects) {
  std::map<uint32_t, std::set<uint32_t>> beside;  // corners that an open edge connects
  for (const Edge& e : open) {
    beside[e.a].insert(e.b);
    beside[e.b].insert(e.a);
  }
  Border border;
  for (const auto& [corner, unused] : beside) {
    border.points.push_back(mesh.positions[corner]);
    border.corner.push_back(corner);
  }
  using Tree = nanoflann::KDTreeSingleIndexAdaptor<nanoflann::L2_Simple_Adaptor<float, Border>, Border, 3, uint32_t>;
  const Tree tree(3, border);
  for (const Edge& e : open) {
    const Vec3 a = mesh.positions[e.a], b = mesh.positions[e.b], middle = (a + b) * 0.5f;
    const float size = length(b - a), near = std::min(kNear, kNearShare * size), reach = 0.5f * size + near;
    std::vector<std::pair<uint32_t, float>> found;
    tree.radiusSearch(&middle.x, reach * reach, found, nanoflann::SearchParams(0, 0, false));
    bool touches = false, misses = false;
    for (const auto& [i, unused] : found) {
      const uint32_t corner = border.corner[i];
      if (corner == e.a || corner == e.b) continue;
      const float distance = distance_beside(border.points[i], a, b);
      touches |= distance <= kTouching;
      // The next corner of the same border is no neighbour that was missed.
      const bool next = beside[corner].contains(e.a) || beside[corner].contains(e.b);
      misses |= !next && distance > kTouching && distance <= near;
    }
    defects->t_junctions += touches;
    defects->cracks += misses && !touches;
  }
}

}  // namespace

Defects find_defects(const Scene& scene) {
  const Welded mesh = weld(scene);
  Defects out;
  std::vector<Corners> corners = mesh.triangles;
  for (Corners& t : corners) std::sort(t.begin(), t.end());
  std::sort(corners.begin(), corners.end());
  for (size_t i = 1; i < corners.size(); ++i) out.duplicates += corners[i] == corners[i - 1];

  struct Use {
    uint32_t low, high;
    bool back;  // the triangle runs from high to low
    auto key() const { return std::pair(low, high); }
    bool operator<(const Use& o) const { return std::tie(low, high, back) < std::tie(o.low, o.high, o.back); }
  };
  std::vector<Use> uses;
  for (const Corners& t : mesh.triangles) {
    for (size_t k = 0; k < 3; ++k) {
      const uint32_t a = t[k], b = t[(k + 1) % 3];
      uses.push_back({std::min(a, b), std::max(a, b), a > b});
    }
  }
  std::sort(uses.begin(), uses.end());
  std::vector<Edge> open;
  for (size_t i = 0, end = 0; i < uses.size(); i = end) {
    while (end < uses.size() && uses[end].key() == uses[i].key()) ++end;
    if (end - i == 1) open.push_back({uses[i].low, uses[i].high});
    if (end - i == 2 && uses[i].back == uses[i + 1].back) ++out.flipped;
  }
  look_along(mesh, open, &out);
  return out;
}

std::string describe(const Defects& d) {
  std::string out;
  const auto add = [&](uint64_t count, const char* one, const char* many) {
    if (count > 0) out += (out.empty() ? "" : ", ") + std::to_string(count) + " " + (count == 1 ? one : many);
  };
  add(d.duplicates, "duplicate triangle", "duplicate triangles");
  add(d.flipped, "edge between triangles that face opposite ways", "edges between triangles that face opposite ways");
  add(d.t_junctions, "T-junction", "T-junctions");
  add(d.cracks, "edge along a crack", "edges along cracks");
  return out;
}

}  // namespace lightloom
