#include "core/base/sh.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "core/base/sampling.h"

namespace lightloom {
namespace {

constexpr double kPiD = 3.14159265358979323846;

struct Node {
  double x, weight;
};

/// Gauss–Legendre nodes on [-1,1] by Newton's method; exact for polynomials up to degree 2n-1.
std::vector<Node> gauss_legendre(int n) {
  std::vector<Node> nodes;
  for (int i = 0; i < n; ++i) {
    double x = std::cos(kPiD * (i + 0.75) / (n + 0.5)), slope = 0;
    for (int step = 0; step < 20; ++step) {
      double p0 = 1, p1 = x;
      for (int k = 2; k <= n; ++k) {
        const double p = ((2 * k - 1) * x * p1 - (k - 1) * p0) / k;
        p0 = p1;
        p1 = p;
      }
      slope = n * (x * p1 - p0) / (x * x - 1);
      x -= p1 / slope;
    }
    nodes.push_back({x, 2 / ((1 - x * x) * slope * slope)});
  }
  return nodes;
}

Vec3 random_direction(Rng* rng) {
  const float u = rng->next_float();
  return square_to_sphere(u, rng->next_float());
}

TEST(Sh, OrthonormalUpToOrder9) {
  // Products have degree 18: 10 nodes in z and 19 in φ would do.
  constexpr int kAround = 32;
  std::vector<double> gram(static_cast<size_t>(kMaxShCount) * kMaxShCount, 0.0);
  std::vector<float> y(kMaxShCount);
  for (const Node& node : gauss_legendre(16)) {
    const double r = std::sqrt(1 - node.x * node.x);
    for (int i = 0; i < kAround; ++i) {
      const double phi = 2 * kPiD * i / kAround;
      const Vec3 d{static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)),
                   static_cast<float>(node.x)};
      sh_evaluate(kMaxShOrder, d, y);
      for (size_t a = 0; a < kMaxShCount; ++a) {
        for (size_t b = 0; b < kMaxShCount; ++b) {
          gram[a * kMaxShCount + b] +=
              node.weight * (2 * kPiD / kAround) * static_cast<double>(y[a]) * static_cast<double>(y[b]);
        }
      }
    }
  }
  for (size_t a = 0; a < kMaxShCount; ++a) {
    for (size_t b = 0; b < kMaxShCount; ++b) {
      ASSERT_NEAR(gram[a * kMaxShCount + b], a == b ? 1 : 0, 1e-5) << a << " " << b;
    }
  }
}

TEST(Sh, AdditionTheorem) {
  Rng rng(1);
  std::vector<float> y(kMaxShCount);
  for (int i = 0; i < 1000; ++i) {
    sh_evaluate(kMaxShOrder, random_direction(&rng), y);
    for (int l = 0; l <= kMaxShOrder; ++l) {
      double sum = 0;
      for (int j = l * l; j < (l + 1) * (l + 1); ++j)
        sum += static_cast<double>(y[static_cast<size_t>(j)]) * static_cast<double>(y[static_cast<size_t>(j)]);
      const double expected = (2 * l + 1) / (4 * kPiD);
      ASSERT_NEAR(sum, expected, 2e-5 * expected) << l;
    }
  }
}

TEST(Sh, FirstBandsAreTheAxes) {
  const float k = std::sqrt(3 / (4 * kPi));
  Rng rng(2);
  std::vector<float> y(4);
  for (int i = 0; i < 100; ++i) {
    const Vec3 d = random_direction(&rng);
    sh_evaluate(1, d, y);
    EXPECT_FLOAT_EQ(y[0], kShDc);
    EXPECT_FLOAT_EQ(y[1], k * d.y);
    EXPECT_FLOAT_EQ(y[2], k * d.z);
    EXPECT_FLOAT_EQ(y[3], k * d.x);
  }
  EXPECT_FLOAT_EQ(kShUniform * kShDc, 1);
}

TEST(Sh, LowerOrdersArePrefixes) {
  Rng rng(3);
  std::vector<float> all(kMaxShCount), some(kMaxShCount);
  const Vec3 d = random_direction(&rng);
  sh_evaluate(kMaxShOrder, d, all);
  for (int order = 0; order <= kMaxShOrder; ++order) {
    sh_evaluate(order, d, some);
    for (size_t j = 0; j < static_cast<size_t>(sh_count(order)); ++j) EXPECT_EQ(some[j], all[j]) << order << " " << j;
  }
}

TEST(Sh, LanesAreBitIdenticalToScalar) {
  Rng rng(4);
  for (int order = 0; order <= kMaxShOrder; ++order) {
    for (int repeat = 0; repeat < 50; ++repeat) {
      alignas(32) float x[kShLanes], y[kShLanes], z[kShLanes];
      alignas(32) float lanes[kMaxShCount * kShLanes];
      Vec3 d[kShLanes];
      for (int i = 0; i < kShLanes; ++i) {
        d[i] = i == 0 && repeat == 0 ? Vec3{0, 0, -1} : random_direction(&rng);
        x[i] = d[i].x;
        y[i] = d[i].y;
        z[i] = d[i].z;
      }
      sh_evaluate_lanes(order, x, y, z, lanes);
      std::vector<float> scalar(static_cast<size_t>(sh_count(order)));
      for (int i = 0; i < kShLanes; ++i) {
        sh_evaluate(order, d[i], scalar);
        for (int j = 0; j < sh_count(order); ++j) {
          ASSERT_EQ(std::bit_cast<uint32_t>(lanes[j * kShLanes + i]),
                    std::bit_cast<uint32_t>(scalar[static_cast<size_t>(j)]))
              << order << " " << j;
        }
      }
    }
  }
}

TEST(Sh, StrideIsAMultipleOf8) {
  EXPECT_EQ(sh_stride(0), 8);
  EXPECT_EQ(sh_stride(1), 8);
  EXPECT_EQ(sh_stride(2), 16);
  EXPECT_EQ(sh_stride(7), 64);
  EXPECT_EQ(sh_stride(9), 104);
}

TEST(Sincos, ErrorBelow2e7) {
  double worst = 0;
  constexpr int kSteps = 1 << 20;
  for (int i = 0; i <= kSteps; ++i) {
    const float u = static_cast<float>(i) / kSteps;
    float s = 0, c = 0;
    sincos_2pi(u, &s, &c);
    const double angle = 2 * kPiD * static_cast<double>(u);
    worst = std::max({worst, std::abs(static_cast<double>(s) - std::sin(angle)),
                      std::abs(static_cast<double>(c) - std::cos(angle))});
  }
  EXPECT_LT(worst, 2e-7);
}

TEST(Sincos, QuarterTurnsAreExact) {
  const float expected[5][2] = {{0, 1}, {1, 0}, {0, -1}, {-1, 0}, {0, 1}};
  for (int i = 0; i <= 4; ++i) {
    float s = 9, c = 9;
    sincos_2pi(static_cast<float>(i) / 4, &s, &c);
    EXPECT_EQ(s, expected[i][0]) << i;
    EXPECT_EQ(c, expected[i][1]) << i;
  }
}

}  // namespace
}  // namespace lightloom
