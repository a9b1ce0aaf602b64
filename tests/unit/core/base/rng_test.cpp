#include "core/base/rng.h"

#include <gtest/gtest.h>

#include <array>
#include <set>

namespace lightloom {
namespace {

TEST(Rng, Mix64IsSplitMix64) {  // first outputs of the reference implementation from state 0
  constexpr uint64_t kGamma = 0x9e3779b97f4a7c15ull;
  EXPECT_EQ(mix64(kGamma), 0xe220a8397b1dcdafull);
  EXPECT_EQ(mix64(2 * kGamma), 0x6e789e6aa1b965f4ull);
  EXPECT_EQ(mix64(3 * kGamma), 0x06c45d188009454full);
}

TEST(Rng, SameKeySameStreamOtherKeyOtherStream) {
  Rng a(5), b(5), c(6);
  int equal = 0;
  for (int i = 0; i < 100; ++i) {
    const uint64_t x = a.next_u64();
    EXPECT_EQ(x, b.next_u64());
    equal += x == c.next_u64();
  }
  EXPECT_EQ(equal, 0);
}

TEST(Rng, FloatsAreMultiplesOf2ToTheMinus24BelowOne) {
  Rng rng(7);
  double sum = 0;
  constexpr int kCount = 100000;
  for (int i = 0; i < kCount; ++i) {
    const float f = rng.next_float();
    ASSERT_GE(f, 0.0f);
    ASSERT_LT(f, 1.0f);
    const float scaled = f * 0x1p24f;
    ASSERT_EQ(scaled, static_cast<float>(static_cast<uint32_t>(scaled)));
    sum += static_cast<double>(f);
  }
  // Standard error of the mean: 1/√(12·100000) = 0.0009.
  EXPECT_NEAR(sum / kCount, 0.5, 0.004);
}

TEST(Rng, NextBelowStaysBelowAndReachesAll) {
  Rng rng(8);
  std::array<int, 7> counts{};
  for (int i = 0; i < 70000; ++i) ++counts.at(rng.next_below(7));
  // Standard deviation of a count: √(10000·6/7) = 93.
  for (const int c : counts) EXPECT_NEAR(c, 10000, 450);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(rng.next_below(1), 0u);
}

TEST(Rng, HashCombineTellsOrderAndKeysApart) {
  std::set<uint64_t> seen;
  for (uint64_t a = 0; a < 100; ++a) {
    for (uint64_t b = 0; b < 100; ++b) seen.insert(hash_combine(a, b));
  }
  EXPECT_EQ(seen.size(), 10000u);
}

}  // namespace
}  // namespace lightloom
