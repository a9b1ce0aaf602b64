// Every set of kernels against the plain loops, one pass at a time.
#include "runtime/simd/kernels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory_resource>
#include <string>

#include "core/base/half.h"
#include "core/base/rng.h"
#include "core/base/sh.h"
#include "runtime/simd/array.h"

namespace lightloom::simd {
namespace {

std::vector<float> random_floats(size_t n, float lo, float hi, uint64_t seed) {
  Rng rng(seed);
  std::vector<float> v(n);
  for (float& f : v) f = lo + (hi - lo) * rng.next_float();
  return v;
}

std::vector<uint16_t> random_halfs(size_t n, uint64_t seed) {
  std::vector<uint16_t> v;
  for (const float f : random_floats(n, -1, 1, seed)) v.push_back(float_to_half(f));
  return v;
}

/// Differences are rounding only: within `sum_of_magnitudes`'s last bits.
void expect_close(const std::vector<float>& actual, const std::vector<float>& expected, float sum_of_magnitudes) {
  ASSERT_EQ(actual.size(), expected.size());
  for (size_t i = 0; i < actual.size(); ++i) {
    ASSERT_NEAR(actual[i], expected[i], 3e-6f * sum_of_magnitudes) << "value " << i;
  }
}

class EverySet : public ::testing::TestWithParam<size_t> {
 protected:
  const Kernels& set_ = *available_kernels().sets[GetParam()];
};

TEST_P(EverySet, Radiosity) {
  const auto direct = random_floats(kTileFloats, 0, 20, 1), albedo = random_floats(kTileFloats, 0, 1, 2);
  const auto emission = random_floats(kTileFloats, 0, 5, 3), e = random_floats(kTileFloats, 0, 9, 4);
  const RadiosityJob job = {direct.data(), albedo.data(), emission.data(), e.data()};
  std::vector<float> actual(kTileFloats), expected(kTileFloats);
  float greatest[3], plain_greatest[3];
  EXPECT_TRUE(set_.radiosity(job, 0, 0, actual.data(), greatest));
  EXPECT_TRUE(kScalarKernels.radiosity(job, 0, 0, expected.data(), plain_greatest));
  expect_close(actual, expected, 20);
  for (uint32_t c = 0; c < 3; ++c) {
    float most = 0;
    for (uint32_t i = c; i < kTileFloats; i += 3) most = std::max(most, actual[i]);
    EXPECT_EQ(greatest[c], most);
    EXPECT_NEAR(plain_greatest[c], most, 1e-5f);
  }
  EXPECT_FALSE(set_.radiosity(job, 0, 0, actual.data(), greatest)) << "nothing has changed";
}

TEST_P(EverySet, RadiosityChangesCountFromEpsilonOn) {
  const std::vector<float> zero(kTileFloats), one(kTileFloats, 1);
  float greatest[3];
  // Each value in turn changes from 1 to 1.25.
  for (uint32_t i = 0; i < kTileFloats; ++i) {
    std::vector<float> emission(kTileFloats, 1), b = one;
    emission[i] = 1.25f;
    const RadiosityJob job = {zero.data(), zero.data(), emission.data(), zero.data()};
    EXPECT_FALSE(set_.radiosity(job, 0.25f, 0, b.data(), greatest));
    EXPECT_EQ(b, one);
    EXPECT_TRUE(set_.radiosity(job, 0.2f, 0, b.data(), greatest));
    EXPECT_EQ(b, emission);
    // Below the floor the change is compared with epsilon · floor.
    b = one;
    EXPECT_FALSE(set_.radiosity(job, 0.125f, 2, b.data(), greatest));
    EXPECT_TRUE(set_.radiosity(job, 0.125f, 1.9f, b.data(), greatest));
  }
}

TEST_P(EverySet, Relight) {
  for (const uint32_t rays : {1u, 255u, 256u, 257u, 700u}) {
    for (const uint32_t stride : {16u, 48u, 112u}) {
      const auto sh = random_floats(size_t{stride} * rays, -1, 1, rays);
      const uint32_t elements = 91;
      const auto radiosity = random_floats(3 * elements + 1, 0, 1, stride);
      std::vector<std::vector<uint32_t>> hits(kRelightProbes, std::vector<uint32_t>(rays));
      Rng rng(rays + stride);
      for (auto& probe : hits) {
        for (uint32_t& hit : probe) hit = rng.next_below(elements);
      }
      for (uint32_t probes = 1; probes <= kRelightProbes; ++probes) {
        RelightJob job{sh.data(), radiosity.data(), {}, rays, stride, 0.01f};
        for (uint32_t p = 0; p < probes; ++p) job.elements[p] = hits[p].data();
        std::vector<float> actual(kRelightColumns * stride, 7), expected(actual);
        set_.relight(job, actual.data());
        kScalarKernels.relight(job, expected.data());
        expect_close(actual, expected, 0.01f * static_cast<float>(rays));
      }
    }
  }
}

/// A probe's λ must not depend on the probes that are relit with it: then it would depend on what else changed.
TEST_P(EverySet, RelightOfAProbeDoesNotDependOnItsGroup) {
  constexpr uint32_t kRays = 300, kStride = 32;
  const auto sh = random_floats(size_t{kStride} * kRays, -1, 1, 1), radiosity = random_floats(3 * 50 + 1, 0, 1, 2);
  std::vector<uint32_t> hits(kRays), others(kRays);
  Rng rng(3);
  for (uint32_t r = 0; r < kRays; ++r) hits[r] = rng.next_below(50), others[r] = rng.next_below(50);
  std::vector<float> alone(kRelightColumns * kStride), together(alone);
  set_.relight({sh.data(), radiosity.data(), {hits.data()}, kRays, kStride, 1}, alone.data());
  set_.relight({sh.data(), radiosity.data(), {others.data(), others.data(), hits.data()}, kRays, kStride, 1},
               together.data());
  EXPECT_TRUE(std::equal(alone.begin(), alone.begin() + 3 * kStride, together.begin() + 6 * kStride));
}

struct TestCluster {
  std::vector<uint16_t> projection, reconstruction, uniform;
  std::vector<float> correction, lambda;
  std::vector<uint32_t> probes;
  uint32_t lambda_stride, padded;  ///< padded: receivers
  ClusterView view;

  TestCluster(uint32_t order, uint32_t P, uint32_t K, uint32_t R) {
    const uint32_t stride = static_cast<uint32_t>(sh_stride(static_cast<int>(order)));
    const uint32_t J = static_cast<uint32_t>(sh_count(static_cast<int>(order)));
    padded = (R + kReceiverAlign - 1) / kReceiverAlign * kReceiverAlign;
    lambda_stride = (J + kLambdaAlign - 1) / kLambdaAlign * kLambdaAlign;
    // What lies behind an array must not matter.
    projection = random_halfs(size_t{K} * P * stride + kOverread, order);
    reconstruction = random_halfs(size_t{K} * padded, P);
    for (const float f : random_floats(padded, 0, 65535, K)) uniform.push_back(static_cast<uint16_t>(f));
    correction = random_floats(K, -1, 1, R);
    for (uint32_t i = 0; i < P; ++i) probes.push_back((3 * i + 1) % (P + 2));
    lambda = random_floats(size_t{P + 2} * 3 * lambda_stride, -1, 1, 9);
    for (size_t i = 0; i < lambda.size(); ++i) {
      if (i % lambda_stride >= J) lambda[i] = 0;
    }
    view = {projection.data(), reconstruction.data(), uniform.data(), correction.data(), probes.data(), K, P, stride};
  }
};

TEST_P(EverySet, ProjectAndReceive) {
  for (const uint32_t order : {0u, 1u, 2u, 5u, 7u, 9u}) {
    for (const uint32_t K : {0u, 1u, 2u, 3u, 7u, 8u, 9u, 21u}) {
      for (const uint32_t R : {1u, 8u, 9u, 31u, 64u, 100u, 256u}) {
        const TestCluster c(order, K == 0 ? 0 : 1 + R % 6, K, R);
        std::vector<float> actual(4 * (K + 1)), expected(actual);
        set_.project(c.view, c.lambda.data(), c.lambda_stride, actual.data());
        kScalarKernels.project(c.view, c.lambda.data(), c.lambda_stride, expected.data());
        expect_close(actual, expected, static_cast<float>(1 + c.view.probe_count * c.view.stride));

        std::vector<float> e(3 * kReceiveBlock), plain(e);
        set_.receive(c.view, expected.data(), 0, c.padded, e.data());
        kScalarKernels.receive(c.view, expected.data(), 0, c.padded, plain.data());
        for (uint32_t colour = 0; colour < 3; ++colour) {
          for (uint32_t r = 0; r < R; ++r) {
            const size_t i = colour * kReceiveBlock + r;
            ASSERT_NEAR(e[i], plain[i], 1e-5f * static_cast<float>(1 + K) * 10) << "receiver " << r;
          }
        }
      }
    }
  }
}

TEST_P(EverySet, SubnormalHalfsCount) {
  TestCluster c(0, 1, 1, 8);
  for (uint16_t& h : c.projection) h = 1;  // 2^-24
  for (uint16_t& h : c.reconstruction) h = 3;
  c.correction[0] = 0;
  std::vector<float> k(8);
  set_.project(c.view, c.lambda.data(), c.lambda_stride, k.data());
  EXPECT_EQ(k[4], 0x1p-24f * c.lambda[3 * c.probes[0] * c.lambda_stride]);
  const float one[8] = {0, 0, 0, 0, 1, 2, 4, 0};
  std::vector<float> e(3 * kReceiveBlock);
  set_.receive(c.view, one, 0, 16, e.data());
  EXPECT_EQ(e[7], 3 * 0x1p-24f);
  EXPECT_EQ(e[2 * kReceiveBlock], 12 * 0x1p-24f);
}

INSTANTIATE_TEST_SUITE_P(Simd, EverySet, ::testing::Range(size_t{0}, available_kernels().count),
                         [](const auto& info) { return std::string(available_kernels().sets[info.param]->name); });

}  // namespace
}  // namespace lightloom::simd
