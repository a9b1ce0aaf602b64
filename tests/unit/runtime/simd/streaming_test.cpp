// Cells and probes that come and go one by one.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>

#include "tests/unit/runtime/simd/simd_level.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

class Streaming : public ::testing::Test {
 protected:
  Streaming() {
    testing::RandomAssetOptions options;
    options.cells = 9;
    asset_ = testing::random_asset(options);
    source_.emplace(*asset_.open());
    light_ = testing::random_light(source_->surface_elements(), 3);
    cells_ = static_cast<uint32_t>(source_->manifest().cells.size());
    probes_ = static_cast<uint32_t>(source_->manifest().probes.size());
    runtime_.emplace(source_->index(), SimdOptions{});
    testing::set_light(light_, &*runtime_);
  }
  void load_cell(uint32_t c) { ASSERT_TRUE(runtime_->load_cell(c, runtime_->pack_cell(*source_->cell(c))).ok()); }
  void load_probe(uint32_t p) { runtime_->load_probe(p, runtime_->pack_probe(*source_->relight(p))); }
  void settle() {
    for (int i = 0; i < 400; ++i) {
      if (runtime_->update().skipped) return;
    }
    FAIL();
  }

  testing::SyntheticAsset asset_;
  std::optional<AssetSource> source_;
  SurfaceLight light_;
  uint32_t cells_ = 0, probes_ = 0;
  std::optional<SimdRuntime> runtime_;
};

TEST_F(Streaming, AnyOrderEndsAtTheSameLight) {
  const auto whole = testing::simd_runtime(*source_);
  testing::set_light(light_, whole.get());
  for (int i = 0; i < 400 && !whole->update().skipped;) ++i;

  // Cells before probes, backwards, with frames in between, some twice.
  for (uint32_t c = cells_; c-- > 0;) load_cell(c);
  for (uint32_t p = probes_; p-- > 0;) {
    load_probe(p);
    if (p % 5 == 0) runtime_->update();
    if (p % 7 == 0) {
      runtime_->unload_probe(p);
      runtime_->update();
      load_probe(p);
      load_probe(p);
    }
  }
  settle();
  EXPECT_LT(testing::largest_error(testing::irradiance(*runtime_), testing::irradiance(*whole)), 1e-5);
  EXPECT_EQ(runtime_->counts().active_cells, cells_);
  EXPECT_EQ(runtime_->counts().bytes, whole->counts().bytes);
}

TEST_F(Streaming, CellTakesPartOnceAllItsProbesAreThere) {
  load_cell(0);
  const CellEntry& entry = source_->manifest().cells[0];
  for (uint32_t i = 0; i < entry.probes; ++i) {
    EXPECT_EQ(runtime_->counts().active_cells, 0u);
    EXPECT_EQ(runtime_->update().updated_cells, 0u);
    load_probe(source_->manifest().cell_probes[entry.first_probe + i]);
  }
  EXPECT_EQ(runtime_->counts().active_cells, 1u);
  EXPECT_EQ(runtime_->update().updated_cells, 1u);
}

TEST_F(Streaming, WhatIsUnloadedKeepsItsLightAndGivesItsMemoryBack) {
  const uint64_t empty = runtime_->counts().bytes;
  for (uint32_t p = 0; p < probes_; ++p) load_probe(p);
  for (uint32_t c = 0; c < cells_; ++c) load_cell(c);
  settle();
  const std::vector<Vec3> before = testing::irradiance(*runtime_);
  for (uint32_t c = 0; c < cells_; ++c) runtime_->unload_cell(c);
  EXPECT_EQ(runtime_->counts().active_cells, 0u);
  for (uint32_t p = 0; p < probes_; ++p) runtime_->unload_probe(p);
  EXPECT_EQ(runtime_->counts().bytes, empty);
  runtime_->set_environment({});
  const SimdStats stats = runtime_->update();
  EXPECT_EQ(stats.updated_probes + stats.updated_cells, 0u);
  EXPECT_EQ(testing::irradiance(*runtime_), before);

  // Back again, it takes part in the light of now.
  for (uint32_t p = 0; p < probes_; ++p) load_probe(p);
  for (uint32_t c = 0; c < cells_; ++c) load_cell(c);
  settle();
  EXPECT_NE(testing::irradiance(*runtime_), before);
}

TEST_F(Streaming, ProbeThatLeavesStopsItsCells) {
  for (uint32_t p = 0; p < probes_; ++p) load_probe(p);
  for (uint32_t c = 0; c < cells_; ++c) load_cell(c);
  const Manifest& m = source_->manifest();
  const uint32_t probe = m.cell_probes[m.cells[0].first_probe];
  runtime_->unload_probe(probe);
  uint32_t without = 0;
  for (const CellEntry& c : m.cells) {
    const auto first = m.cell_probes.begin() + c.first_probe;
    without += std::find(first, first + c.probes, probe) == first + c.probes;
  }
  EXPECT_EQ(runtime_->counts().active_cells, without);
  EXPECT_EQ(runtime_->update().updated_cells, without);
}

TEST_F(Streaming, ReceiverOfTwoCellsIsRefusedUntilTheOtherLeaves) {
  load_cell(0);
  const SourceCell same = *source_->cell(0);
  EXPECT_EQ(runtime_->load_cell(1, runtime_->pack_cell(same)).code(), absl::StatusCode::kDataLoss);
  EXPECT_EQ(runtime_->counts().resident_cells, 1u);
  runtime_->unload_cell(0);
  EXPECT_TRUE(runtime_->load_cell(1, runtime_->pack_cell(same)).ok());

  SourceCell twice = *source_->cell(2);
  twice.elements.back() = twice.elements.front();
  EXPECT_EQ(runtime_->load_cell(2, runtime_->pack_cell(twice)).code(), absl::StatusCode::kDataLoss);
  load_cell(2);  // the refused one has left no trace
}

}  // namespace
}  // namespace lightloom
