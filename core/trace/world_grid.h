// The world cut into cubes: by them, what a result was computed from is compared with what an edit has changed.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>

#include "core/base/vec.h"

namespace lightloom {

/// Cells of side 2^level metres, anchored to the origin, and the box of them that holds a level.
struct WorldGrid {
  static constexpr uint32_t kMostAlong = 1u << 11;    ///< cells along an axis
  static constexpr uint64_t kMostCells = 1ull << 18;  ///< of the box

  int32_t level = 0;
  GridCell lo{};                   ///< the box's first cell
  std::array<uint32_t, 3> size{};  ///< cells of the box along each axis

  /// Cells of about half a probe cell, or larger where the box would hold too many; at least one around `bounds`.
  /// REQUIRES: bounds not empty, spacing > 0.
  static WorldGrid around(const Aabb& bounds, float spacing);

  double side() const { return std::ldexp(1.0, level); }
  uint64_t cells() const { return uint64_t{size[0]} * size[1] * size[2]; }
  bool contains(const GridCell& cell) const;
  /// In rows along z, then y, then x. REQUIRES: contains(cell).
  uint32_t index(const GridCell& cell) const;
  GridCell cell(uint32_t index) const;
  /// The cell that p lies in, which may be outside of the box.
  GridCell cell_at(Vec3 p) const;
  /// The same, or the box's nearest one.
  GridCell nearest(Vec3 p) const;
  bool operator==(const WorldGrid&) const = default;
};

}  // namespace lightloom
