// Equal contents mean that rays find the same.
#include "core/trace/world_contents.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>

#include "tests/support/test_scenes.h"
#include "tests/unit/core/trace/small_world.h"

namespace lightloom {
namespace {

using test::SmallWorld;

TEST(WorldContents, NoOrderShows) {
  Scene scene = test::room_with_crate();
  const WorldContents straight = SmallWorld(scene).contents;
  std::reverse(scene.objects.begin(), scene.objects.end());
  const WorldContents reversed = SmallWorld(scene).contents;
  EXPECT_EQ(straight.cells, reversed.cells);
  EXPECT_EQ(straight.contents, reversed.contents);
}

TEST(WorldContents, ColoursAreNoContents) {
  Scene scene = test::room_with_crate();
  const WorldContents grey = SmallWorld(scene).contents;
  for (Material& m : scene.materials) m.base_color = {1, 0, 0}, m.emission = {3, 3, 3};
  test::identify(&scene);
  EXPECT_EQ(SmallWorld(scene).contents.contents, grey.contents);
}

TEST(WorldContents, EveryTriangleIsInEveryCellItReaches) {
  const SmallWorld world(test::room_with_crate());
  std::map<uint32_t, CellContents> of_cell;
  for (size_t i = 0; i < world.contents.cells.size(); ++i) {
    of_cell[world.contents.cells[i]] = world.contents.contents[i];
  }
  for (const Object& object : world.scene.objects) {
    for (const Triangle& t : object.triangles) {
      for (int i = 0; i <= 40; ++i) {
        for (int k = 0; i + k <= 40; ++k) {
          const Vec3 p = interpolate(object.positions, t, static_cast<float>(i) / 40, static_cast<float>(k) / 40);
          ASSERT_FALSE(of_cell[world.contents.grid.index(world.contents.grid.cell_at(p))].geometry.empty());
        }
      }
    }
  }
}

TEST(WorldContents, ReceiversCountApart) {
  const SmallWorld world(test::room_with_crate());
  uint64_t with_receivers = 0;
  for (const CellContents& c : world.contents.contents) with_receivers += !c.receivers.empty();
  EXPECT_GT(with_receivers, 20u);
  EXPECT_LT(with_receivers, world.contents.cells.size()) << "outside of the walls there are none";
}

}  // namespace
}  // namespace lightloom
