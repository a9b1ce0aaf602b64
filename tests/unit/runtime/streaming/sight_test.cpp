#include "runtime/streaming/sight.h"

#include <gtest/gtest.h>

#include "core/base/sh.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

constexpr int kRays = 1024;

/// Three cells in a row along x, a metre each, one receiver in the middle of each; a probe in each end.
///   cell 0: probe 0 |  cell 1  | cell 2: probe 1
class SightTest : public ::testing::Test {
 protected:
  SightTest() : asset_(testing::empty_asset(1, kRays)) {
    const ChunkObject object = asset_.add_object(4, 1, {0, 1, 2});
    for (const float x : {0.5f, 2.5f}) {
      RelightChunk probe;
      probe.position = {x, 0.5f, 0.5f};
      probe.objects = {object};
      probe.rays.assign(kRays, RelightChunk::kDead);
      asset_.add_probe(probe);
    }
    for (uint32_t c = 0; c < 3; ++c) {
      CellChunk cell;
      cell.order = 1;
      cell.probe_count = 1;
      cell.objects = {object};
      cell.receivers = {{0, c}};
      cell.uniform = {0};
      cell.near_counts = {0};
      CellChunk::Cluster cluster;
      cluster.receivers = 1;
      cluster.probes = {0};
      cluster.bounds = {positions_[c], positions_[c]};
      cell.clusters = {cluster};
      asset_.add_cell(cell, {0});
      CellEntry& entry = asset_.manifest.cells.back();
      entry.cell = {static_cast<int32_t>(c), 0, 0};
      entry.bounds = {positions_[c], positions_[c]};
    }
    index_.emplace(*AssetIndex::create(asset_.manifest, std::pmr::get_default_resource()));
    sight_.emplace(*index_);
    sight_->add_surface(0, positions_);
  }
  /// Rays along +x end at `right`, those along −x at `left`.
  std::vector<uint32_t> rays(uint32_t left, uint32_t right) const {
    std::vector<uint32_t> out;
    for (uint32_t r = 0; r < kRays; ++r) out.push_back(sphere_direction(r, kRays).x < 0 ? left : right);
    return out;
  }

  const std::vector<Vec3> positions_ = {{0.5f, 0.9f, 0.5f}, {1.5f, 0.9f, 0.5f}, {2.5f, 0.9f, 0.5f}};
  testing::SyntheticAsset asset_;
  std::optional<AssetIndex> index_;
  std::optional<Sight> sight_;
};

TEST_F(SightTest, WithoutProbesWhatIsNearIsImportant) {
  const std::vector<float> i = sight_->importance({0.5f, 0.5f, 0.5f});
  EXPECT_GT(i[0], i[1]);
  EXPECT_GT(i[1], i[2]);
}

TEST_F(SightTest, WhatTheNearestProbeSeesIsImportant) {
  sight_->add_probe(0, rays(RelightChunk::kDead, 2));
  sight_->add_probe(1, rays(1, RelightChunk::kSky));
  // At a probe it is the share of its rays: a half, of which the root is taken.
  EXPECT_NEAR(sight_->importance({0.5f, 0.5f, 0.55f})[2], std::sqrt(0.5f), 0.06f);
  const std::vector<float> right = sight_->importance({2.5f, 0.5f, 0.55f});
  EXPECT_GT(right[1], right[2]);
  EXPECT_GT(right[1], right[0]);
}

/// The first probe is nearer to the eye, but behind a wall at its own cell's receiver.
TEST_F(SightTest, AProbeBehindAWallHasLittleToSay) {
  sight_->add_probe(0, rays(0, 0));
  sight_->add_probe(1, rays(1, 2));
  const std::vector<float> i = sight_->importance({1.4f, 0.5f, 0.5f});
  EXPECT_GT(i[1], 2 * i[0]);
}

}  // namespace
}  // namespace lightloom
