#include "cli/view/overlays.h"

#include <gtest/gtest.h>

#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"

namespace lightloom::view {
namespace {

using renderer::Rgba;

TEST(Overlays, HeatGoesFromBlueToRed) {
  EXPECT_EQ(heat(0, 9), (Rgba{0, 0, 255, 9}));
  EXPECT_EQ(heat(0.25f, 9), (Rgba{0, 255, 255, 9}));
  EXPECT_EQ(heat(0.5f, 9), (Rgba{0, 255, 0, 9}));
  EXPECT_EQ(heat(0.75f, 9), (Rgba{255, 255, 0, 9}));
  EXPECT_EQ(heat(1, 9), (Rgba{255, 0, 0, 9}));
  EXPECT_EQ(heat(7, 9), heat(1, 9));
}

TEST(Overlays, NeighboursDiffer) {
  for (uint32_t i = 0; i < 100; ++i) EXPECT_NE(distinct(i, 255), distinct(i + 1, 255));
}

class BakedOverlays : public ::testing::Test {
 protected:
  static const test::BakedLevel& level() {
    static const auto baked = [] {
      BakeParams params;
      params.texels_per_metre = 2;
      params.rays = 16;
      params.relight_rays = 64;
      params.cell_receivers = 256;
      return test::bake_level(*builtin_scene("cornell"), params);
    }();
    return *baked;
  }
};

TEST_F(BakedOverlays, EveryReceiverHasItsCellAndCluster) {
  const auto owners = find_owners(level().loom(), level().manifest, *level().scene, level().elements);
  ASSERT_TRUE(owners.ok()) << owners.status();
  std::vector<uint32_t> in_cluster(level().manifest.clusters.size());
  for (size_t i = 0; i < owners->cell.size(); ++i) {
    ASSERT_LT(owners->cell[i], level().manifest.cells.size());
    const CellEntry& cell = level().manifest.cells[owners->cell[i]];
    EXPECT_GE(owners->cluster[i], cell.first_cluster);
    EXPECT_LT(owners->cluster[i], cell.first_cluster + cell.clusters);
    EXPECT_GT(owners->half[i], 0);
    ++in_cluster[owners->cluster[i]];
  }
  for (size_t c = 0; c < in_cluster.size(); ++c) EXPECT_EQ(in_cluster[c], level().manifest.clusters[c].receivers);
}

TEST_F(BakedOverlays, MarksAreOneForEachThingThatIsShown) {
  const Manifest& manifest = level().manifest;
  const auto owners = *find_owners(level().loom(), manifest, *level().scene, level().elements);
  const size_t receivers = level().elements.receivers.all.size();
  const auto marks = [&](const std::set<std::string>& shown) {
    return overlay_marks(shown, manifest, level().elements, owners, std::vector<uint8_t>(manifest.cells.size(), 1));
  };
  EXPECT_TRUE(marks({"panel", "lights"}).lines.empty());
  EXPECT_EQ(marks({"cells"}).lines.size(), 24 * manifest.cells.size());
  EXPECT_EQ(marks({"cells"}).triangles.size(), 6 * receivers);
  EXPECT_EQ(marks({"ranks"}).triangles.size(), 6 * receivers);
  EXPECT_EQ(marks({"residency"}).triangles.size(), 6 * receivers);
  EXPECT_EQ(marks({"residency"}).lines[0].colour[0], 230);  // all have their base
  EXPECT_EQ(marks({"probes"}).triangles.size(), 24 * manifest.probes.size());
}

TEST_F(BakedOverlays, StaleCellsAreRedderTheMoreOfThemChanged) {
  Manifest manifest = level().manifest;
  ASSERT_GE(manifest.cells.size(), 3u);
  manifest.cells[1].stale = 0.01f;
  manifest.cells[2].stale = 0.02f;
  const auto owners = *find_owners(level().loom(), manifest, *level().scene, level().elements);
  const auto lines = overlay_marks({"stale"}, manifest, level().elements, owners, {}).lines;
  const auto colour_of = [&](size_t cell) { return lines[24 * cell].colour; };
  EXPECT_GT(colour_of(0)[1], colour_of(0)[0]);  // fresh: green
  EXPECT_EQ(colour_of(2), (Rgba{255, 0, 0, colour_of(2)[3]}));
  EXPECT_GT(colour_of(1)[1], colour_of(2)[1]);
}

}  // namespace
}  // namespace lightloom::view
