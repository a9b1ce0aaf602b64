#include "runtime/asset_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class AssetSourceTest : public ::testing::Test {
 protected:
  AssetSourceTest() : asset_(testing::empty_asset(0, 3)) {
    first_ = asset_.add_object(2, 2, {1, 6});
    second_ = asset_.add_object(3, 1, {0, 2, 5});
    // Ray codes: `second` has 0..5, `first` 6..13.
    probe_.objects = {second_, first_};
    probe_.rays = {5, RelightChunk::kSky, 6 + 1};
    cell_.objects = {second_, first_};
    cell_.receivers = {{1, 6}, {0, 2}};
    cell_.uniform = {1, 2};
    cell_.near_counts = {0, 1};
    cell_.near_texels = {5};
    cell_.near_weights = {9};
    CellChunk::Cluster cluster;
    cluster.receivers = 2;
    cluster.probes = {0};
    cluster.bounds.extend({0, 0, 0});
    cell_.clusters = {cluster};
    cell_.probe_count = 1;
  }
  absl::StatusOr<AssetSource> open() {
    asset_.add_probe(probe_);
    asset_.add_cell(cell_, {0});
    return asset_.open();
  }
  void expect_bad_cell(const char* why) {
    const auto source = open();
    ASSERT_TRUE(source.ok()) << source.status();
    const auto cell = source->cell(0);
    EXPECT_EQ(cell.status().code(), absl::StatusCode::kDataLoss);
    EXPECT_THAT(std::string(cell.status().message()), HasSubstr(why));
  }

  testing::SyntheticAsset asset_;
  ChunkObject first_, second_;
  RelightChunk probe_;
  CellChunk cell_;
};

TEST_F(AssetSourceTest, NumbersElementsByManifestOrderAndKey) {
  const auto source = open();
  ASSERT_TRUE(source.ok()) << source.status();
  EXPECT_EQ(source->surface_elements(), 5u);  // first: keys 1, 6; second: keys 0, 2, 5
  EXPECT_THAT(source->cell(0)->elements, ElementsAre(1, 3));
  EXPECT_THAT(source->cell(0)->near_elements, ElementsAre(4));
  EXPECT_THAT(*source->relight(0), ElementsAre(4, RelightChunk::kSky, 0));
}

TEST_F(AssetSourceTest, NearTexelOutsideTheSurface) {
  cell_.near_texels[0] = 1;
  expect_bad_cell("a near texel is no texel of its object's surface");
}

TEST_F(AssetSourceTest, ReceiverOutsideTheSurface) {
  cell_.receivers[0].key = 0;
  expect_bad_cell("no texel of its object's surface");
}

TEST_F(AssetSourceTest, ObjectThatTheManifestDoesNotHave) {
  cell_.objects[1].id.bytes[0] ^= 1;
  expect_bad_cell("not in the manifest");
}

TEST_F(AssetSourceTest, ObjectOfAnotherSize) {
  cell_.objects[1].width = 4;
  expect_bad_cell("not in the manifest");
}

TEST_F(AssetSourceTest, CellThatDisagreesWithTheManifest) {
  cell_.order = 1;
  expect_bad_cell("does not match");
}

TEST_F(AssetSourceTest, RayOutsideTheSurface) {
  probe_.rays[0] = 1;
  const auto source = open();
  ASSERT_TRUE(source.ok()) << source.status();
  EXPECT_EQ(source->relight(0).status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(AssetSourceTest, TooFewRays) {
  probe_.rays.pop_back();
  EXPECT_EQ(open()->relight(0).status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(AssetSourceTest, ReceiverTwice) {
  cell_.receivers[1] = cell_.receivers[0];
  const auto source = open();
  const auto cell = source->cell(0);
  ASSERT_TRUE(cell.ok()) << cell.status();
  std::vector<bool> received(source->surface_elements());
  EXPECT_EQ(mark_receivers(0, *cell, &received).code(), absl::StatusCode::kDataLoss);
}

TEST_F(AssetSourceTest, SameObjectTwice) {
  asset_.manifest.objects.push_back(asset_.manifest.objects[0]);
  EXPECT_EQ(open().status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(AssetSourceTest, SurfaceOfAnotherObject) {
  std::swap(asset_.manifest.objects[0].surface, asset_.manifest.objects[1].surface);
  EXPECT_EQ(open().status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(AssetSourceTest, FlippedByteIsFoundByTheDigest) {
  asset_.chunks[asset_.manifest.objects[0].surface.digest].back() ^= 1;
  const auto source = open();
  EXPECT_EQ(source.status().code(), absl::StatusCode::kDataLoss);
  EXPECT_THAT(std::string(source.status().message()), HasSubstr("SHA-256"));
}

TEST_F(AssetSourceTest, ClaimedSizeIsNotAllocated) {
  asset_.manifest.objects[0].surface.size = uint64_t{1} << 60;
  EXPECT_EQ(open().status().code(), absl::StatusCode::kDataLoss);
}

TEST_F(AssetSourceTest, TooManyRelightRays) {
  asset_.manifest.params.relight_rays = 1 << 30;
  EXPECT_EQ(open().status().code(), absl::StatusCode::kUnimplemented);
}

}  // namespace
}  // namespace lightloom
