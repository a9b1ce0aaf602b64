// Traces of an earlier bake come from a folder that anything may have happened to: they decode to what was encoded, or not
// at all.
#include "core/bake/bake_traces.h"

#include <gtest/gtest.h>

#include "tests/unit/core/bake/hostile_bytes.h"
#include "tests/unit/core/bake/sample_traces.h"

namespace lightloom {
namespace {

using test::with;

constexpr size_t kGrid = 8, kContents = 36, kCellRecords = 40, kRelightBytes = 44, kCells = 64;

TEST(BakeTraces, RoundTrip) {
  const BakeTraces in = test::sample_traces();
  const auto out = decode_bake_traces(encode_bake_traces(in));
  ASSERT_TRUE(out.ok()) << out.status();
  EXPECT_EQ(out->world.grid, in.world.grid);
  EXPECT_EQ(out->world.cells, in.world.cells);
  EXPECT_EQ(out->world.contents, in.world.contents);
  ASSERT_EQ(out->cells.size(), 2u);
  EXPECT_EQ(out->cells[1].key, in.cells[1].key);
  EXPECT_EQ(out->cells[1].trace, in.cells[1].trace);
  ASSERT_EQ(out->probes.size(), 1u);
  EXPECT_EQ(out->probes[0].probe, in.probes[0].probe);
  EXPECT_EQ(out->probes[0].key, in.probes[0].key);
  EXPECT_EQ(out->probes[0].chunk, in.probes[0].chunk);
  EXPECT_EQ(out->probes[0].trace, in.probes[0].trace);
  EXPECT_EQ(encode_bake_traces(*out), encode_bake_traces(in));
}

TEST(BakeTraces, RefuseOtherLengthsAndCounts) {
  const auto bytes = encode_bake_traces(test::sample_traces());
  test::expect_exact_length(bytes, decode_bake_traces);
  for (const size_t at : {size_t{0}, size_t{4}, kContents, kCellRecords, kRelightBytes}) {
    test::expect_count_checked(bytes, at, decode_bake_traces);
  }
}

TEST(BakeTraces, RefuseAWorldThatIsNone) {
  const auto bytes = encode_bake_traces(test::sample_traces());
  const auto refused = [&](size_t at, auto value) {
    return decode_bake_traces(with(bytes, at, value)).status().code() == absl::StatusCode::kDataLoss;
  };
  EXPECT_TRUE(refused(kGrid, 100));         // level
  EXPECT_TRUE(refused(kGrid + 16, 0u));     // size
  EXPECT_TRUE(refused(kGrid + 16, 5000u));  // along x
  EXPECT_TRUE(refused(kCells, 4u));         // not ascending
  EXPECT_TRUE(refused(kCells + 4, 6u));     // beyond the grid
}

TEST(BakeTraces, AnyFlippedByteIsReadOrRefused) {
  const auto bytes = encode_bake_traces(test::sample_traces());
  for (size_t i = 0; i < bytes.size(); ++i) {
    const auto result = decode_bake_traces(with(bytes, i, static_cast<uint8_t>(~bytes[i])));
    EXPECT_TRUE(result.ok() || absl::IsDataLoss(result.status())) << i;
  }
}

}  // namespace
}  // namespace lightloom
