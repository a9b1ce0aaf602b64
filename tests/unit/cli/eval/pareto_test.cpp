#include "cli/eval/pareto.h"

#include <gtest/gtest.h>

namespace lightloom::eval {
namespace {

TEST(Pareto, ThePointsThatNoOtherBeats) {
  const std::vector<Cost> points = {{3, 1}, {1, 3}, {2, 2}, {2, 4}, {4, 1}, {3, 0.5}};
  EXPECT_EQ(pareto_front(points), (std::vector<size_t>{1, 2, 5}));
}

TEST(Pareto, EqualPointsAreAllOnIt) { EXPECT_EQ(pareto_front({{1, 1}, {1, 1}, {2, 1}}), (std::vector<size_t>{0, 1})); }

TEST(Pareto, AgreesWithItsDefinition) {
  std::vector<Cost> points;
  for (int i = 0; i < 60; ++i) points.push_back({static_cast<double>(i * 37 % 23), static_cast<double>(i * 53 % 29)});
  std::vector<bool> on(points.size());
  for (const size_t i : pareto_front(points)) on[i] = true;
  for (size_t i = 0; i < points.size(); ++i) {
    bool beaten = false;
    for (const Cost& other : points) beaten |= beats(other, points[i]);
    EXPECT_EQ(on[i], !beaten) << i;
  }
}

TEST(Pareto, BetweenItsPointsAFrontIsStraightInLogarithms) {
  const std::vector<Cost> front = {{1, 0.4}, {4, 0.1}, {8, 0.05}};
  EXPECT_NEAR(*error_at(front, 2), 0.2, 1e-12);
  EXPECT_EQ(*error_at(front, 4), 0.1);
  EXPECT_EQ(*error_at(front, 100), 0.05);  // what is cheaper will do
  EXPECT_FALSE(error_at(front, 0.9));
  EXPECT_NEAR(*cost_at(front, 0.2), 2, 1e-12);
  EXPECT_EQ(*cost_at(front, 0.05), 8);
  EXPECT_EQ(*cost_at(front, 1), 1);
  EXPECT_FALSE(cost_at(front, 0.04));
  EXPECT_FALSE(error_at({}, 1));
}

TEST(Pareto, NothingHasNoFront) { EXPECT_TRUE(pareto_front({}).empty()); }

}  // namespace
}  // namespace lightloom::eval
