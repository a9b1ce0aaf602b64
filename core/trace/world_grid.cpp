#include "core/trace/world_grid.h"

#include <algorithm>

#include "core/base/check.h"

namespace lightloom {
namespace {

int32_t cell_along(double x, double side) {
  constexpr double kFarthest = 1 << 30;
  return static_cast<int32_t>(std::clamp(std::floor(x / side), -kFarthest, kFarthest));
}

}  // namespace

WorldGrid WorldGrid::around(const Aabb& bounds, float spacing) {
  LL_CHECK(!bounds.empty() && spacing > 0);
  constexpr int kPerProbeCell = 1;  // 2^1 along each axis: finer ones find few more results that hold (ADR 0006)
  WorldGrid grid;
  for (grid.level = std::ilogb(spacing) - kPerProbeCell;; ++grid.level) {
    const double side = grid.side();
    bool fits = true;
    for (int a = 0; a < 3; ++a) {
      const size_t n = static_cast<size_t>(a);
      fits &= (static_cast<double>(bounds.hi[a]) - static_cast<double>(bounds.lo[a])) / side < kMostAlong - 4;
      grid.lo[n] = cell_along(bounds.lo[a], side) - 1;
      grid.size[n] = static_cast<uint32_t>(cell_along(bounds.hi[a], side) + 2 - grid.lo[n]);
    }
    if (fits && grid.cells() <= kMostCells) return grid;
  }
}

bool WorldGrid::contains(const GridCell& cell) const {
  for (size_t a = 0; a < 3; ++a) {
    if (cell[a] < lo[a] || static_cast<int64_t>(cell[a]) - lo[a] >= size[a]) return false;
  }
  return true;
}

uint32_t WorldGrid::index(const GridCell& cell) const {
  const auto at = [&](size_t a) { return static_cast<uint32_t>(cell[a] - lo[a]); };
  return (at(0) * size[1] + at(1)) * size[2] + at(2);
}

GridCell WorldGrid::cell(uint32_t index) const {
  const auto at = [&](size_t a, uint32_t i) { return lo[a] + static_cast<int32_t>(i); };
  return {at(0, index / size[2] / size[1]), at(1, index / size[2] % size[1]), at(2, index % size[2])};
}

GridCell WorldGrid::cell_at(Vec3 p) const {
  return {cell_along(p.x, side()), cell_along(p.y, side()), cell_along(p.z, side())};
}

GridCell WorldGrid::nearest(Vec3 p) const {
  GridCell cell = cell_at(p);
  for (size_t a = 0; a < 3; ++a) cell[a] = std::clamp(cell[a], lo[a], lo[a] + static_cast<int32_t>(size[a]) - 1);
  return cell;
}

}  // namespace lightloom
