#include "core/trace/world_grid.h"

#include <gtest/gtest.h>

namespace lightloom {
namespace {

TEST(WorldGrid, HoldsTheBoundsAndACellAround) {
  const Aabb bounds{{-3.2f, 0, 1}, {5, 2.9f, 1}};
  const WorldGrid grid = WorldGrid::around(bounds, 2);
  EXPECT_EQ(grid.level, 0);
  EXPECT_EQ(grid.side(), 1.0);
  EXPECT_EQ(grid.lo, (GridCell{-5, -1, 0}));
  EXPECT_EQ(grid.size, (std::array<uint32_t, 3>{12, 5, 3}));
  EXPECT_TRUE(grid.contains({-5, -1, 0}));
  EXPECT_TRUE(grid.contains({6, 3, 2}));
  EXPECT_FALSE(grid.contains({7, 3, 2}));
  EXPECT_FALSE(grid.contains({-6, 0, 0}));
}

TEST(WorldGrid, IsAnchoredToTheWorld) {
  const WorldGrid a = WorldGrid::around({{0, 0, 0}, {9, 3, 9}}, 1.6f);
  const WorldGrid b = WorldGrid::around({{-0.3f, 0, 0}, {9.7f, 3, 9}}, 1.6f);
  EXPECT_EQ(a.level, b.level);
  EXPECT_EQ(a.cell_at({4.4f, 1, 2}), b.cell_at({4.4f, 1, 2}));
}

TEST(WorldGrid, IndicesAndCellsAreEachOthersInverse) {
  const WorldGrid grid = WorldGrid::around({{-1, -2, -3}, {2, 2, 5}}, 3);
  for (uint32_t i = 0; i < grid.cells(); ++i) {
    ASSERT_TRUE(grid.contains(grid.cell(i)));
    ASSERT_EQ(grid.index(grid.cell(i)), i);
  }
}

TEST(WorldGrid, LargeLevelsHaveLargerCells) {
  for (const float length : {1e3f, 1e5f, 1e8f}) {
    const WorldGrid grid = WorldGrid::around({{0, 0, 0}, {length, 10, length}}, 1);
    EXPECT_LE(grid.cells(), WorldGrid::kMostCells);
    for (const uint32_t size : grid.size) EXPECT_LE(size, WorldGrid::kMostAlong);
    EXPECT_TRUE(grid.contains(grid.cell_at({length, 10, length})));
  }
  EXPECT_LE(WorldGrid::around({{0, 0, 0}, {1e7f, 0, 0}}, 1).size[0], WorldGrid::kMostAlong);
}

TEST(WorldGrid, NearestStaysInTheBox) {
  const WorldGrid grid = WorldGrid::around({{0, 0, 0}, {3, 3, 3}}, 4);
  EXPECT_EQ(grid.nearest({1.5f, 2.5f, 0.5f}), grid.cell_at({1.5f, 2.5f, 0.5f}));
  EXPECT_TRUE(grid.contains(grid.nearest({-100, 1e9f, 2})));
}

}  // namespace
}  // namespace lightloom
