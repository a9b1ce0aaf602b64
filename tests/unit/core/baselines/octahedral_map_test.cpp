#include "core/baselines/octahedral_map.h"

#include <gtest/gtest.h>

#include "core/base/sh.h"

namespace lightloom {
namespace {

using Map = OctahedralMap<6>;

TEST(OctahedralMap, TexelCentresReadThemselves) {
  for (size_t y = 0; y < 6; ++y) {
    for (size_t x = 0; x < 6; ++x) {
      std::vector<float> map(Map::kTexels, 0.0f);
      map[Map::index(x, y)] = 1;
      Map::fill_border<float>(map);
      EXPECT_NEAR(Map::tap(Map::direction(x, y)).blend([&](size_t t) { return map[t]; }), 1, 1e-5f) << x << " " << y;
    }
  }
}

// What is kept is a direction's components: they come back everywhere, over the map's edges and corners too.
TEST(OctahedralMap, LookupsAreContinuousOverTheEdges) {
  std::vector<Vec3> map(Map::kTexels);
  for (size_t y = 0; y < 6; ++y) {
    for (size_t x = 0; x < 6; ++x) map[Map::index(x, y)] = Map::direction(x, y);
  }
  Map::fill_border<Vec3>(map);
  for (uint32_t i = 0; i < 4096; ++i) {
    const Vec3 d = sphere_direction(i, 4096);
    const Vec3 read = Map::tap(d).blend([&](size_t t) { return map[t]; });
    ASSERT_LT(length(read - d), 0.2f) << d.x << " " << d.y << " " << d.z;
  }
}

}  // namespace
}  // namespace lightloom
