#include "core/baselines/ddgi_visibility.h"

#include <gtest/gtest.h>

#include <vector>

#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

/// Mean distances in the inside of a 4 m cube, from somewhere.
class DdgiDistances : public ::testing::Test {
 protected:
  float mean(Vec3 probe, float farthest, Vec3 direction) {
    const auto tracer = test::value_or_die(RayTracer::create(scene_));
    std::vector<Vec2> map(DistanceMap::kTexels);
    filter_distances(*tracer, probe, farthest, 8192, map);
    return DistanceMap::tap(direction).blend([&](size_t t) { return map[t].x; });
  }
  Scene scene_ = test::closed_box({4, 4, 4});
};

// Face on; the lobe blurs by a few per cent.
TEST_F(DdgiDistances, OfAWallAreThoseToIt) {
  EXPECT_NEAR(mean({3, 2, 2}, 9, {1, 0, 0}), 1, 0.06f);
  EXPECT_NEAR(mean({3, 2, 2}, 9, {-1, 0, 0}), 3, 0.2f);
  EXPECT_NEAR(mean({3, 2, 2}, 9, {0, 1, 0}), 2, 0.12f);
}

TEST_F(DdgiDistances, EndAtTheFarthest) { EXPECT_NEAR(mean({3, 2, 2}, 1.5f, {-1, 0, 0}), 1.5f, 1e-5f); }

// A back that is dark looks five times as near; one with light of its own does not.
TEST_F(DdgiDistances, OfBacksAreShortened) {
  EXPECT_NEAR(mean({5, 2, 2}, 9, {-1, 0, 0}), 0.2f, 0.02f);
  for (Material& m : scene_.materials) m.double_sided = true;
  EXPECT_NEAR(mean({5, 2, 2}, 9, {-1, 0, 0}), 1, 0.06f);
}

TEST(DdgiWeight, VisibilityFollowsChebyshev) {
  const Vec2 moments{2, 4.25f};  // variance 0.25
  EXPECT_EQ(chebyshev_visibility(moments, 1.9f), 1);
  EXPECT_NEAR(chebyshev_visibility(moments, 2.5f), 0.125f, 1e-6f);  // (0.25 ÷ (0.25 + 0.5²))³
  EXPECT_EQ(chebyshev_visibility(moments, 9), 0.05f);
}

TEST(DdgiWeight, FavoursWhatIsInFrontAndInSight) {
  EXPECT_FLOAT_EQ(ddgi_weight(1, 1), 1.2f);
  EXPECT_FLOAT_EQ(ddgi_weight(0, 1), 0.45f);
  EXPECT_FLOAT_EQ(ddgi_weight(-1, 0.5f), 0.1f * 0.1f * 0.1f / (0.2f * 0.2f));  // crushed
  EXPECT_NEAR(ddgi_weight(0, 0.2f / 0.45f - 1e-4f), ddgi_weight(0, 0.2f / 0.45f + 1e-4f), 5e-4f);
}

}  // namespace
}  // namespace lightloom
