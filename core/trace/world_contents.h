// What each cell of the world holds, as hashes: equal hashes mean that rays there find the same.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/receivers/layout.h"
#include "core/receivers/receivers.h"
#include "core/scene/scene.h"
#include "core/trace/world_grid.h"

namespace lightloom {

/// A sum, so that no order shows, of 128-bit hashes that no edit matches by chance.
struct ContentHash {
  std::array<uint64_t, 2> sum{};

  void add(const ContentHash& item) {
    for (size_t i = 0; i < sum.size(); ++i) sum[i] += item.sum[i];
  }
  bool empty() const { return sum == std::array<uint64_t, 2>{}; }
  bool operator==(const ContentHash&) const = default;
};

struct CellContents {
  /// Of the triangles that reach into the cell, or lie near its faces: the identity of each one's object, with its lightmap.
  ContentHash geometry;
  ContentHash receivers;  ///< of those in the cell: which they are, and where
  bool operator==(const CellContents&) const = default;
};

struct WorldContents {
  WorldGrid grid;
  std::vector<uint32_t> cells;         ///< that are not empty: indices in the grid, ascending
  std::vector<CellContents> contents;  ///< of each of them
};

/// Of a level's static objects and its receivers. The grid holds them all.
WorldContents contents_of(const Scene& scene, const AtlasLayout& layout, const Receivers& receivers,
                          const WorldGrid& grid);

}  // namespace lightloom
