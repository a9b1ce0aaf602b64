#include "runtime/streaming/plan.h"

#include <gtest/gtest.h>

#include <set>

#include "runtime/cell_block.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

class PlanTest : public ::testing::Test {
 protected:
  PlanTest() {
    testing::RandomAssetOptions o;
    o.order = 7;
    o.relight_rays = 4096;
    o.objects = 6;
    o.probes = 40;
    o.cells = 20;
    asset_ = testing::random_asset(o);
    source_.emplace(*asset_.open());
    importance_.assign(index().cells().size(), 0.01f);
    now_.cells.assign(index().cells().size(), CellLevel::kBase);
    now_.probes.assign(index().probes().size(), ProbeLevel::kBase);
  }
  const AssetIndex& index() const { return source_->index(); }
  uint64_t bytes_of(const StreamLevels& levels) const {
    const StreamCosts costs(index());
    uint64_t bytes = 0;
    for (uint32_t c = 0; c < levels.cells.size(); ++c) bytes += costs.cell(c, levels.cells[c]);
    for (const ProbeLevel level : levels.probes) bytes += costs.probe(level);
    return bytes;
  }
  StreamLevels choose(uint64_t budget) const {
    const StreamCosts costs(index());
    return choose_levels(index(), costs, rank_steps(index(), costs, importance_, now_), budget);
  }

  testing::SyntheticAsset asset_;
  std::optional<AssetSource> source_;
  std::vector<float> importance_;
  StreamLevels now_;
};

TEST_F(PlanTest, CostsAreTheBlocksBytes) {
  const StreamCosts costs(index());
  for (uint32_t c = 0; c < index().cells().size(); ++c) {
    uint64_t before = 0;
    for (const CellLevel level : {CellLevel::kBase, CellLevel::kSome, CellLevel::kAll}) {
      SourceCell cell = *source_->cell(c);
      limit(&cell, detail_of(level));
      const auto block = make_cell_block(cell, UINT64_MAX, std::pmr::get_default_resource());
      ASSERT_TRUE(block.ok());
      const uint64_t cost = costs.cell(c, level) - before;
      // The chunk's table of objects is taken for near fields: 8 bytes for each 6.
      const double objects = 40.0 * 8 / 6 * static_cast<double>(cell.chunk.objects.size());
      EXPECT_NEAR(static_cast<double>(cost) - objects, static_cast<double>(block->bytes),
                  0.02 * static_cast<double>(block->bytes) + 256);
      before = costs.cell(c, CellLevel::kBase);
    }
  }
}

TEST_F(PlanTest, BudgetsAreKeptAndUsed) {
  const StreamCosts costs(index());
  uint64_t largest = 0;
  for (const StreamStep& s : rank_steps(index(), costs, importance_, now_)) largest = std::max(largest, s.bytes);
  const uint64_t all = bytes_of(choose(UINT64_MAX)), bases = bytes_of(choose(0));
  for (uint64_t budget = bases; budget < all; budget += (all - bases) / 50) {
    const uint64_t bytes = bytes_of(choose(budget));
    EXPECT_LE(bytes, budget);
    // What is left over is too little for some step.
    EXPECT_GT(bytes + largest, budget);
  }
  const StreamLevels everything = choose(UINT64_MAX);
  for (const CellLevel level : everything.cells) EXPECT_EQ(level, CellLevel::kAll);
}

TEST_F(PlanTest, WhatIsSeenComesFirst) {
  importance_[7] = 0.5f;
  const StreamCosts costs(index());
  const uint64_t bases = bytes_of(choose(0));
  const StreamLevels levels = choose(bases + costs.cell(7, CellLevel::kAll));
  EXPECT_EQ(levels.cells[7], CellLevel::kAll);
  for (uint32_t c = 0; c < levels.cells.size(); ++c) EXPECT_NE(levels.cells[c], CellLevel::kNone);
}

TEST_F(PlanTest, AStepThatDoesNotFitKeepsNoOtherOut) {
  const StreamCosts costs(index());
  uint32_t large = 0;
  for (uint32_t c = 1; c < index().cells().size(); ++c) {
    if (costs.cell(c, CellLevel::kAll) > costs.cell(large, CellLevel::kAll)) large = c;
  }
  importance_[large] = 1000;  // pinned
  const uint64_t step = costs.cell(large, CellLevel::kAll) - costs.cell(large, CellLevel::kSome);
  const StreamLevels levels = choose(bytes_of(choose(0)) + step / 2);
  EXPECT_NE(levels.cells[large], CellLevel::kAll);
  size_t more = 0;
  for (const CellLevel level : levels.cells) more += level > CellLevel::kBase;
  EXPECT_GT(more, 0u);
}

TEST_F(PlanTest, StepsOfACellAreInOrder) {
  const StreamCosts costs(index());
  std::vector<uint8_t> level(index().cells().size(), 1);
  double last = 1e30;
  for (const StreamStep& s : rank_steps(index(), costs, importance_, now_)) {
    EXPECT_LE(s.density, last);
    last = s.density;
    if (s.kind != AssetIndex::Kind::kCell) continue;
    EXPECT_GT(s.level, level[s.index]);
    EXPECT_EQ(s.bytes, costs.cell(s.index, static_cast<CellLevel>(s.level)) -
                           costs.cell(s.index, static_cast<CellLevel>(level[s.index])));
    level[s.index] = s.level;
  }
}

/// Two cells of about the same worth do not take each other's place when one becomes a little more important.
TEST_F(PlanTest, WhatIsThereStaysUntilSomethingIsClearlyBetter) {
  const uint64_t budget = bytes_of(choose(0)) + (bytes_of(choose(UINT64_MAX)) - bytes_of(choose(0))) / 2;
  const StreamLevels first = choose(budget);
  now_ = first;
  for (size_t c = 0; c < importance_.size(); ++c) importance_[c] *= c % 2 == 0 ? 1.1f : 1;
  const StreamLevels second = choose(budget);
  size_t lost = 0, changed = 0;
  for (size_t c = 0; c < importance_.size(); ++c) lost += second.cells[c] < first.cells[c];
  EXPECT_EQ(lost, 0u);
  for (size_t c = 0; c < importance_.size(); ++c) importance_[c] *= c % 2 == 0 ? 10.0f : 1;
  const StreamLevels third = choose(budget);
  for (size_t c = 0; c < importance_.size(); ++c) changed += third.cells[c] != first.cells[c];
  EXPECT_GT(changed, 0u);
}

}  // namespace
}  // namespace lightloom
