#include "cli/eval/rank_correlation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace lightloom::eval {
namespace {

using Values = std::vector<double>;

TEST(RankCorrelation, AsksForTheOrderAlone) {
  EXPECT_DOUBLE_EQ(rank_correlation(Values{1, 2, 3, 4}, Values{1, 10, 11, 1e6}), 1);
  EXPECT_DOUBLE_EQ(rank_correlation(Values{1, 2, 3, 4}, Values{4, 3, 0, -9}), -1);
}

// Without ties ρ = 1 − 6·Σd² ÷ (n·(n² − 1)): ranks 1 2 3 4 5 against 2 1 4 3 5, Σd² = 4, ρ = 1 − 24/120.
TEST(RankCorrelation, IsSpearmansFormula) {
  EXPECT_DOUBLE_EQ(rank_correlation(Values{10, 20, 30, 40, 50}, Values{2, 1, 4, 3, 5}), 0.8);
}

// Ranks 1 2½ 2½ 4 against 1 2 3 4: Σ(x − x̄)(y − ȳ) = 2.25 + 0 + 0 + 2.25 = 4.5, Σ(x − x̄)² = 4.5, Σ(y − ȳ)² = 5.
TEST(RankCorrelation, EqualValuesShareARank) {
  EXPECT_DOUBLE_EQ(rank_correlation(Values{1, 7, 7, 9}, Values{1, 2, 3, 4}), 4.5 / std::sqrt(4.5 * 5));
  EXPECT_DOUBLE_EQ(rank_correlation(Values{1, 7, 7, 9}, Values{1, 2, 2, 4}), 1);
}

TEST(RankCorrelation, OfAConstantIsZero) {
  EXPECT_EQ(rank_correlation(Values{3, 3, 3}, Values{1, 2, 3}), 0);
  EXPECT_EQ(rank_correlation(Values{}, Values{}), 0);
}

}  // namespace
}  // namespace lightloom::eval
