// Slow and obvious checks of lightmap coordinates, independent of the library's rasteriser.
#pragma once

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <string>
#include <tuple>
#include <vector>

#include "core/receivers/atlas.h"

namespace lightloom::oracle {

using Corners = std::array<Vec2, 3>;

inline double twice_area(const Corners& t) {
  return (double{t[1].x} - t[0].x) * (double{t[2].y} - t[0].y) - (double{t[1].y} - t[0].y) * (double{t[2].x} - t[0].x);
}

/// Strictly inside, of either orientation.
inline bool inside(const Corners& t, double x, double y) {
  const double sign = twice_area(t) < 0 ? -1 : 1;
  for (size_t e = 0; e < 3; ++e) {
    const Vec2 a = t[e], b = t[(e + 1) % 3];
    if (sign * ((double{b.x} - a.x) * (y - a.y) - (double{b.y} - a.y) * (x - a.x)) <= 0) return false;
  }
  return twice_area(t) != 0;
}

/// True if the open square [x,x+1]×[y,y+1] meets the triangle: no edge of either separates them.
inline bool meets_texel(const Corners& t, int x, int y) {
  const auto [l, r] = std::minmax({t[0].x, t[1].x, t[2].x});
  const auto [b, h] = std::minmax({t[0].y, t[1].y, t[2].y});
  if (r <= x || l >= x + 1 || h <= y || b >= y + 1 || twice_area(t) == 0) return false;
  const double sign = twice_area(t) < 0 ? -1 : 1;
  for (size_t e = 0; e < 3; ++e) {
    const Vec2 p = t[e], q = t[(e + 1) % 3];
    double most = -1e30;
    for (int k = 0; k < 4; ++k) {
      const double cx = x + (k & 1), cy = y + (k >> 1);
      most = std::max(most, sign * ((double{q.x} - p.x) * (cy - p.y) - (double{q.y} - p.y) * (cx - p.x)));
    }
    if (most <= 0) return false;
  }
  return true;
}

template <class F>
void for_each_texel(const LightmapUv& uv, const Corners& t, const F& f) {
  const auto [l, r] = std::minmax({t[0].x, t[1].x, t[2].x});
  const auto [b, h] = std::minmax({t[0].y, t[1].y, t[2].y});
  for (int y = std::max(0, static_cast<int>(b)); y <= std::min(uv.height - 1, static_cast<int>(h)); ++y) {
    for (int x = std::max(0, static_cast<int>(l)); x <= std::min(uv.width - 1, static_cast<int>(r)); ++x) f(x, y);
  }
}

/// Triangles joined by an edge that coincides in space and in the lightmap belong to one island. One number
/// each.
inline std::vector<int> islands(const Object& object, const LightmapUv& uv) {
  const size_t n = object.triangles.size();
  std::vector<int> parent(n);
  std::iota(parent.begin(), parent.end(), 0);
  const auto root = [&](int i) {
    while (parent[static_cast<size_t>(i)] != i) i = parent[static_cast<size_t>(i)];
    return i;
  };
  using Corner = std::array<float, 5>;
  std::map<std::pair<Corner, Corner>, int> edges;
  for (size_t t = 0; t < n; ++t) {
    if (twice_area(uv.corners[t]) == 0) continue;
    for (size_t e = 0; e < 3; ++e) {
      const auto corner = [&](size_t k) {
        const Vec3 p = object.positions[object.triangles[t].v[k]];
        return Corner{p.x, p.y, p.z, uv.corners[t][k].x, uv.corners[t][k].y};
      };
      const auto ends = std::minmax({corner(e), corner((e + 1) % 3)});
      const auto [it, added] = edges.try_emplace({ends.first, ends.second}, static_cast<int>(t));
      if (!added) parent[static_cast<size_t>(root(static_cast<int>(t)))] = root(it->second);
    }
  }
  std::vector<int> island(n);
  for (size_t t = 0; t < n; ++t) island[t] = root(static_cast<int>(t));
  return island;
}

/// What is wrong with the atlas: corners outside, texel centres in two triangles, islands closer than one
/// texel (on texels that they touch at all). Empty if nothing is.
inline std::string defects(const Object& object, const LightmapUv& uv) {
  if (uv.corners.size() != object.triangles.size()) return "not one entry per triangle";
  for (const Corners& t : uv.corners) {
    for (const Vec2& p : t) {
      if (!(p.x >= 0 && p.x <= static_cast<float>(uv.width) && p.y >= 0 && p.y <= static_cast<float>(uv.height))) {
        return "a corner lies outside";
      }
    }
  }
  const std::vector<int> island = islands(object, uv);
  const auto texel = [&](int x, int y) {
    return static_cast<size_t>(y) * static_cast<size_t>(uv.width) + static_cast<size_t>(x);
  };
  const size_t texels = static_cast<size_t>(uv.width) * static_cast<size_t>(uv.height);
  std::vector<bool> centre(texels, false);
  std::vector<int> owner(texels, -1);
  std::string found;
  for (size_t t = 0; t < uv.corners.size(); ++t) {
    for_each_texel(uv, uv.corners[t], [&](int x, int y) {
      const std::string where = " at texel " + std::to_string(x) + ", " + std::to_string(y);
      if (inside(uv.corners[t], x + 0.5, y + 0.5)) {
        if (centre[texel(x, y)]) found = "two triangles" + where;
        centre[texel(x, y)] = true;
      }
      if (meets_texel(uv.corners[t], x, y)) {
        if (x == 0 || y == 0 || x == uv.width - 1 || y == uv.height - 1) found = "no border" + where;
        int& o = owner[texel(x, y)];
        if (o >= 0 && o != island[t]) found = "two charts" + where;
        o = island[t];
      }
    });
  }
  for (int y = 1; y < uv.height; ++y) {
    for (int x = 1; x + 1 < uv.width; ++x) {
      const int o = owner[texel(x, y)];
      for (const int other :
           {owner[texel(x - 1, y)], owner[texel(x - 1, y - 1)], owner[texel(x, y - 1)], owner[texel(x + 1, y - 1)]}) {
        if (o >= 0 && other >= 0 && o != other)
          found = "no gutter at texel " + std::to_string(x) + ", " + std::to_string(y);
      }
    }
  }
  return found;
}

/// Texels of the lightmap per m² of surface.
inline double density(const Object& object, const LightmapUv& uv) {
  double texels = 0, area = 0;
  for (size_t t = 0; t < object.triangles.size(); ++t) {
    const Triangle& triangle = object.triangles[t];
    const Vec3 a = object.positions[triangle.v[0]], b = object.positions[triangle.v[1]];
    area += length(cross(b - a, object.positions[triangle.v[2]] - a));
    texels += std::abs(twice_area(uv.corners[t]));
  }
  return texels / area;
}

}  // namespace lightloom::oracle
