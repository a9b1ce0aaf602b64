#include "core/transport/sh_accumulator.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/base/sampling.h"

namespace lightloom {
namespace {

struct Weighted {
  std::vector<Vec3> directions;
  std::vector<float> weights;
};

Weighted random_directions(size_t count, uint64_t seed) {
  Rng rng(seed);
  Weighted out;
  for (size_t i = 0; i < count; ++i) {
    const float u = rng.next_float();
    out.directions.push_back(square_to_sphere(u, rng.next_float()));
    out.weights.push_back(0.1f + rng.next_float());
  }
  return out;
}

/// Relative to Σ|w|·max|Y|, what rounding scales with.
void expect_close(int order, const Weighted& in, const std::vector<float>& sum) {
  std::vector<float> expected(sum.size(), 0);
  accumulate_sh_scalar(order, in.directions, in.weights, expected);
  double scale = 0;
  for (const float w : in.weights) scale += static_cast<double>(w);
  for (size_t j = 0; j < sum.size(); ++j) {
    ASSERT_NEAR(static_cast<double>(sum[j]), static_cast<double>(expected[j]), 1e-5 * scale)
        << order << " " << in.weights.size() << " " << j;
  }
}

TEST(ShAccumulator, EqualsTheScalarSum) {
  for (int order = 0; order <= kMaxShOrder; ++order) {
    for (size_t count = 0; count <= 40; ++count) {
      const Weighted in = random_directions(count, 100 + count);
      ShAccumulator a(order);
      for (size_t i = 0; i < count; ++i) a.add(in.directions[i], in.weights[i]);
      std::vector<float> sum(static_cast<size_t>(sh_count(order)), 0);
      a.flush_into(sum);
      expect_close(order, in, sum);
    }
  }
}

TEST(ShAccumulator, FlushAddsAndStartsAnew) {
  const Weighted in = random_directions(11, 1);
  ShAccumulator a(3);
  std::vector<float> once(16, 0), again(16, 1);
  for (size_t i = 0; i < 11; ++i) a.add(in.directions[i], in.weights[i]);
  a.flush_into(once);
  for (size_t i = 0; i < 11; ++i) a.add(in.directions[i], in.weights[i]);
  a.flush_into(again);
  for (size_t j = 0; j < 16; ++j) EXPECT_EQ(again[j], 1 + once[j]) << j;
  std::vector<float> nothing(16, 2);
  a.flush_into(nothing);
  EXPECT_EQ(nothing, std::vector<float>(16, 2));
}

TEST(ShAccumulator, SameDirectionsSameBits) {
  const Weighted in = random_directions(37, 2);
  std::vector<float> sums[2];
  for (std::vector<float>& sum : sums) {
    sum.assign(64, 0);
    ShAccumulator a(7);
    for (size_t i = 0; i < 37; ++i) a.add(in.directions[i], in.weights[i]);
    a.flush_into(sum);
  }
  EXPECT_EQ(sums[0], sums[1]);
}

TEST(ShAccumulator, CopiesAreIndependent) {
  const Weighted in = random_directions(5, 3);
  ShAccumulator a(2);
  a.add(in.directions[0], 1);
  ShAccumulator b = a;
  b.add(in.directions[1], 1);
  std::vector<float> sum(9, 0), expected(9, 0);
  a.flush_into(sum);
  const float one = 1;
  accumulate_sh_scalar(2, {in.directions.data(), 1}, {&one, 1}, expected);
  for (size_t j = 0; j < 9; ++j) EXPECT_FLOAT_EQ(sum[j], expected[j]);
}

}  // namespace
}  // namespace lightloom
