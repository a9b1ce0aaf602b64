// Cell records come from other machines: they decode to what was encoded, or not at all.
#include "core/bake/cell_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

#include "tests/unit/core/bake/hostile_bytes.h"

namespace lightloom {
namespace {

using test::with;
using ::testing::HasSubstr;

CellRecord record() {
  CellRecord r;
  r.chunk = {sha256("chunk"), 4000};
  r.bounds = {{-1, 0, 2}, {1, 2, 3}};
  r.gather_rays = 1800;
  r.unseen = 7;
  r.error = 0.0125;
  r.key = sha256("key");
  r.trace = {{-1, {0, -4, 2}, {1, 2, 3}}, 7, {0x10, 0x35}};  // two cells that no ray crossed, four that some did
  r.stale = 0.25f;
  r.near = {{{sha256("floor"), 4, 4}, {3, 8}}, {{sha256("wall"), 2, 2}, {1}}};
  r.probes = {{{2, 0, 0}, 0}, {{3, 0, 0}, 0}, {{3, 0, 0}, 4}};
  r.clusters = {{{{-1, 0, 2}, {0, 1, 3}}, 30, 4, 3, 0.01f}, {{{0, 0, 2}, {1, 2, 3}}, 20, 1, 2, 0.02f}};
  r.coefficients = 30 * 4 + 20;
  r.bytes_projection = 1000;
  r.bytes_reconstruction = 500;
  return r;
}
// Offsets of the header's fields.
constexpr size_t kProbes = 8, kClusters = 12, kChunkSize = 80, kLo = 88, kUnseen = 120, kError = 128,
                 kCoefficients = 136, kBytesProjection = 144, kStale = 160, kProbeNames = 176, kClusterList = 224,
                 kNearKeys = 352, kTrace = 420, kSky = kTrace + 28, kRunCount = kTrace + 32, kRuns = 464;

TEST(CellRecord, RoundTrip) {
  const CellRecord in = record();
  const auto out = decode_cell_record(encode_cell_record(in));
  ASSERT_TRUE(out.ok()) << out.status();
  EXPECT_EQ(out->chunk, in.chunk);
  EXPECT_EQ(out->bounds.lo, in.bounds.lo);
  EXPECT_EQ(out->bounds.hi, in.bounds.hi);
  EXPECT_EQ(out->gather_rays, in.gather_rays);
  EXPECT_EQ(out->unseen, in.unseen);
  EXPECT_EQ(out->error, in.error);
  EXPECT_EQ(out->key, in.key);
  EXPECT_EQ(out->near, in.near);
  EXPECT_EQ(out->trace, in.trace);
  EXPECT_EQ(out->stale, in.stale);
  EXPECT_EQ(out->probes, in.probes);
  EXPECT_EQ(out->receivers(), 50u);
  ASSERT_EQ(out->clusters.size(), 2u);
  EXPECT_EQ(out->clusters[1].rank, 1u);
  EXPECT_EQ(out->clusters[1].error, 0.02f);
  EXPECT_EQ(encode_cell_record(*out), encode_cell_record(in));
}

TEST(CellRecord, RefusesOtherLengthsAndCounts) {
  const auto bytes = encode_cell_record(record());
  test::expect_exact_length(bytes, decode_cell_record);
  test::expect_count_checked(bytes, 0, decode_cell_record);  // magic
  test::expect_count_checked(bytes, 4, decode_cell_record);  // version
  test::expect_count_checked(bytes, kProbes, decode_cell_record);
  test::expect_count_checked(bytes, kClusters, decode_cell_record);
  // Receivers, rank and probes of the first cluster: sums and sizes no longer fit.
  test::expect_count_checked(bytes, kClusterList + 24, decode_cell_record);
  test::expect_count_checked(bytes, kClusterList + 28, decode_cell_record);
  test::expect_count_checked(bytes, kNearKeys - 8, decode_cell_record);
  test::expect_count_checked(bytes, kRunCount, decode_cell_record);
}

TEST(CellRecord, RefusesNumbersOutOfRange) {
  const auto bytes = encode_cell_record(record());
  const auto error = [](const std::vector<uint8_t>& changed) {
    const auto result = decode_cell_record(changed);
    EXPECT_EQ(result.status().code(), absl::StatusCode::kDataLoss);
    return std::string(result.status().message());
  };
  constexpr float kNan = std::numeric_limits<float>::quiet_NaN(), kInf = std::numeric_limits<float>::infinity();
  EXPECT_THAT(error(with(bytes, kLo, kNan)), HasSubstr("bounds"));
  EXPECT_THAT(error(with(bytes, kLo, -kInf)), HasSubstr("bounds"));
  EXPECT_THAT(error(with(bytes, kLo, 5.0f)), HasSubstr("bounds"));
  EXPECT_THAT(error(with(bytes, kError, std::numeric_limits<double>::quiet_NaN())), HasSubstr("error"));
  EXPECT_THAT(error(with(bytes, kError, -1.0)), HasSubstr("error"));
  EXPECT_THAT(error(with(bytes, kUnseen, uint64_t{1801})), HasSubstr("unseen"));
  EXPECT_THAT(error(with(bytes, kChunkSize, uint64_t{0})), HasSubstr("no chunk"));
  EXPECT_THAT(error(with(bytes, kCoefficients, uint64_t{139})), HasSubstr("coefficients"));
  EXPECT_THAT(error(with(bytes, kBytesProjection, ~uint64_t{0})), HasSubstr("larger"));
  EXPECT_THAT(error(with(bytes, kProbeNames, 3u)), HasSubstr("ascend"));
  EXPECT_THAT(error(with(bytes, kClusterList, kNan)), HasSubstr("cluster's bounds"));
  EXPECT_THAT(error(with(bytes, kClusterList + 32, 4u)), HasSubstr("more probes"));
  EXPECT_THAT(error(with(bytes, kClusterList + 36, kInf)), HasSubstr("cluster's error"));
  EXPECT_THAT(error(with(bytes, kNearKeys, 8u)), HasSubstr("near fields do not ascend"));
  EXPECT_THAT(error(with(bytes, kStale, 1.5f)), HasSubstr("staleness"));
  EXPECT_THAT(error(with(bytes, kStale, kNan)), HasSubstr("staleness"));
  EXPECT_THAT(error(with(bytes, kTrace, 61)), HasSubstr("grid"));
  EXPECT_THAT(error(with(bytes, kTrace + 16, 0u)), HasSubstr("grid"));
  EXPECT_THAT(error(with(bytes, kTrace + 16, 4096u)), HasSubstr("grid"));
  EXPECT_THAT(error(with(bytes, kTrace + 16, 2u)), HasSubstr("does not cover its grid"));
  EXPECT_THAT(error(with(bytes, kRuns, uint8_t{0x20})), HasSubstr("does not cover its grid"));
  EXPECT_THAT(error(with(bytes, kSky, 16u)), HasSubstr("sky"));
}

TEST(CellRecord, AnyFlippedByteIsReadOrRefused) {
  const auto bytes = encode_cell_record(record());
  for (size_t i = 0; i < bytes.size(); ++i) {
    const auto result = decode_cell_record(with(bytes, i, static_cast<uint8_t>(~bytes[i])));
    if (result.ok()) continue;
    EXPECT_THAT(std::string(result.status().message()), HasSubstr("; run the cell's task again"));
  }
}

}  // namespace
}  // namespace lightloom
