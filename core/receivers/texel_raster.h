// Exact rasterisation of triangles in fixed point. Triangles that share an edge never share a sample, and
// leave none out.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <utility>

namespace lightloom {

/// Steps per texel: a power of two, so that coordinates are exact as float too.
constexpr int32_t kGrid = 256;

/// In 1/kGrid texels. Within ±2^28 so that products of differences fit 64 bits.
struct GridPoint {
  int32_t x = 0, y = 0;
  bool operator==(const GridPoint&) const = default;
};
using GridTriangle = std::array<GridPoint, 3>;

/// Where samples lie: sample (i,j) at (i·step + offset, j·step + offset).
struct SampleLattice {
  int32_t step = kGrid, offset = kGrid / 2;  ///< texel centres
};

inline int64_t floor_div(int64_t a, int64_t b) {
  const int64_t q = a / b;
  return q - ((a % b != 0) && ((a < 0) != (b < 0)) ? 1 : 0);
}
/// REQUIRES: b != 0. Both round correctly for either sign of b.
inline int64_t ceil_div(int64_t a, int64_t b) { return -floor_div(-a, b); }

/// Twice the signed area.
inline int64_t twice_area(const GridTriangle& t) {
  return int64_t{t[1].x - t[0].x} * (t[2].y - t[0].y) - int64_t{t[1].y - t[0].y} * (t[2].x - t[0].x);
}

/// Calls span(j, first, last) for each row j that has samples inside the triangle, of either orientation:
/// those with first <= i <= last. margin = 0 uses a fill rule that gives samples on a shared edge to one
/// side; margin > 0 takes only samples at least that far (1/kGrid texels) from every edge. Stops early once
/// span() returns false.
template <class Span>
void rasterise(GridTriangle t, SampleLattice lattice, int32_t margin, const Span& span) {
  const int64_t area = twice_area(t);
  if (area == 0) return;
  if (area < 0) std::swap(t[1], t[2]);

  const auto [low, high] = std::minmax({t[0].y, t[1].y, t[2].y});
  const int64_t first_row = ceil_div(int64_t{low} - lattice.offset, lattice.step);
  const int64_t last_row = floor_div(int64_t{high} - lattice.offset, lattice.step);
  const auto [left, right] = std::minmax({t[0].x, t[1].x, t[2].x});
  for (int64_t j = first_row; j <= last_row; ++j) {
    const int64_t y = j * lattice.step + lattice.offset;
    int64_t lo = left, hi = right;
    for (int e = 0; e < 3; ++e) {
      const GridPoint a = t[static_cast<size_t>(e)], b = t[static_cast<size_t>((e + 1) % 3)];
      const int64_t dx = int64_t{b.x} - a.x, dy = int64_t{b.y} - a.y;
      // Inside: dx (y - a.y) - dy (x - a.x) >= least, that is dy x <= c.
      const bool owns_edge = dy > 0 || (dy == 0 && dx < 0);
      const int64_t least = margin > 0 ? margin * (std::abs(dx) + std::abs(dy)) : (owns_edge ? 0 : 1);
      const int64_t c = dx * (y - a.y) + dy * a.x - least;
      if (dy > 0) {
        hi = std::min(hi, floor_div(c, dy));
      } else if (dy < 0) {
        lo = std::max(lo, ceil_div(c, dy));
      } else if (c < 0) {
        hi = lo - 1;
      }
    }
    const int64_t first = ceil_div(lo - lattice.offset, lattice.step);
    const int64_t last = floor_div(hi - lattice.offset, lattice.step);
    if (first > last) continue;
    if (!span(static_cast<int32_t>(j), static_cast<int32_t>(first), static_cast<int32_t>(last))) return;
  }
}

}  // namespace lightloom
