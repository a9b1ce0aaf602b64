// Warps against their densities by χ² tests. Seeds are fixed, so a test passes or fails always; a right warp
// would fail one seed in ten thousand.
#include "core/base/sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

namespace lightloom {
namespace {

constexpr int kZBins = 16, kPhiBins = 24;
constexpr double kTwoPi = 6.28318530717958647692;

size_t bin_of(Vec3 d) {
  double phi = std::atan2(static_cast<double>(d.y), static_cast<double>(d.x));
  if (phi < 0) phi += kTwoPi;
  const int z = std::clamp(static_cast<int>((static_cast<double>(d.z) + 1) / 2 * kZBins), 0, kZBins - 1);
  return static_cast<size_t>(z * kPhiBins + std::min(static_cast<int>(phi / kTwoPi * kPhiBins), kPhiBins - 1));
}

/// Probability of each bin: the density integrated by midpoints (bins have equal solid angle 4π ÷ bins).
std::vector<double> probabilities(const std::function<double(Vec3)>& pdf) {
  constexpr int kSteps = 16;
  std::vector<double> p(kZBins * kPhiBins, 0);
  for (int i = 0; i < kZBins * kSteps; ++i) {
    for (int k = 0; k < kPhiBins * kSteps; ++k) {
      const double z = -1 + 2 * (i + 0.5) / (kZBins * kSteps), phi = kTwoPi * (k + 0.5) / (kPhiBins * kSteps);
      const double r = std::sqrt(1 - z * z);
      const Vec3 d{static_cast<float>(r * std::cos(phi)), static_cast<float>(r * std::sin(phi)), static_cast<float>(z)};
      p[static_cast<size_t>(i / kSteps * kPhiBins + k / kSteps)] +=
          pdf(d) * 2 * kTwoPi / (kZBins * kSteps * kPhiBins * kSteps);
    }
  }
  return p;
}

struct ChiSquare {
  double statistic = 0;
  int freedom = -1;
  /// The statistic that a right sampler exceeds once in 10000 times (Wilson & Hilferty 1931).
  double limit() const {
    const double s = 2.0 / (9.0 * freedom), root = 1 - s + 3.719 * std::sqrt(s);
    return freedom * root * root * root;
  }
};

ChiSquare chi_square(const std::vector<Vec3>& samples, const std::function<double(Vec3)>& pdf) {
  const std::vector<double> p = probabilities(pdf);
  std::vector<double> counts(p.size(), 0);
  for (const Vec3 d : samples) ++counts[bin_of(d)];
  ChiSquare out;
  for (size_t i = 0; i < p.size(); ++i) {
    const double expected = p[i] * static_cast<double>(samples.size());
    if (expected == 0) {
      EXPECT_EQ(counts[i], 0) << "samples where the density is 0";
      continue;
    }
    EXPECT_GE(expected, 5) << "the bins are too fine for the test";
    out.statistic += (counts[i] - expected) * (counts[i] - expected) / expected;
    ++out.freedom;
  }
  return out;
}

constexpr int kSamples = 400000;

template <class Warp>
std::vector<Vec3> draw(uint64_t seed, const Warp& warp) {
  Rng rng(seed);
  std::vector<Vec3> out;
  for (int i = 0; i < kSamples; ++i) {
    const float u = rng.next_float();
    out.push_back(warp(u, rng.next_float()));
  }
  return out;
}

double uniform_pdf(Vec3) { return 1 / (2 * kTwoPi); }
double cosine_pdf(Vec3 d) { return static_cast<double>(square_to_cosine_hemisphere_pdf(d)); }

void expect_unit(const std::vector<Vec3>& directions) {
  for (const Vec3 d : directions) ASSERT_NEAR(length(d), 1.0f, 1e-6f);
}

TEST(Sampling, CosineHemisphereFollowsItsDensity) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const auto samples = draw(seed, square_to_cosine_hemisphere);
    expect_unit(samples);
    const ChiSquare test = chi_square(samples, cosine_pdf);
    EXPECT_EQ(test.freedom, kZBins / 2 * kPhiBins - 1);
    EXPECT_LT(test.statistic, test.limit()) << seed;
  }
}

TEST(Sampling, SphereFollowsItsDensity) {
  for (uint64_t seed = 1; seed <= 3; ++seed) {
    const auto samples = draw(seed, square_to_sphere);
    expect_unit(samples);
    const ChiSquare test = chi_square(samples, uniform_pdf);
    EXPECT_LT(test.statistic, test.limit()) << seed;
  }
}

TEST(Sampling, TheTestTellsSlightlyWrongDensitiesApart) {
  const auto wrong = [](Vec3 d) { return uniform_pdf(d) * (1 + 0.06 * static_cast<double>(d.z)); };
  const ChiSquare test = chi_square(draw(1, square_to_sphere), wrong);
  EXPECT_GT(test.statistic, test.limit());
}

TEST(Sampling, SquareCornersStayInRange) {
  for (const float u : {0.0f, 0x1.fffffep-1f}) {
    for (const float v : {0.0f, 0x1.fffffep-1f}) {
      EXPECT_NEAR(length(square_to_sphere(u, v)), 1, 1e-6);
      const Vec3 d = square_to_cosine_hemisphere(u, v);
      EXPECT_NEAR(length(d), 1, 1e-6);
      EXPECT_GT(d.z, 0) << "never along the surface";
    }
  }
}

TEST(Sampling, StratifiedPutsOneSampleIntoEachStratum) {
  constexpr uint32_t kSide = 7;
  Rng rng(3);
  for (uint32_t i = 0; i < kSide * kSide; ++i) {
    const Sample2 s = stratified(i, kSide, &rng);
    EXPECT_EQ(static_cast<uint32_t>(s.u * kSide), i % kSide);
    EXPECT_EQ(static_cast<uint32_t>(s.v * kSide), i / kSide);
    EXPECT_LT(s.u, 1);
    EXPECT_LT(s.v, 1);
  }
}

TEST(Sampling, ToWorldTurnsZIntoTheNormal) {
  Rng rng(4);
  for (int i = 0; i < 1000; ++i) {
    const float u = rng.next_float();
    const Vec3 n = i == 0 ? Vec3{0, 0, -1} : square_to_sphere(u, rng.next_float());
    const Vec3 z = to_world({0, 0, 1}, n);
    EXPECT_NEAR(length(z - n), 0, 1e-6);
    Vec3 s, t;
    orthonormal_basis(n, &s, &t);
    EXPECT_NEAR(length(cross(s, t) - n), 0, 2e-6);
    EXPECT_NEAR(dot(s, t), 0, 1e-6);
  }
}

TEST(SphereDirection, EqualAreaAndUnit) {
  for (const uint32_t n : {4096u, 10000u}) {
    std::vector<Vec3> directions;
    Vec3 sum;
    for (uint32_t i = 0; i < n; ++i) {
      directions.push_back(sphere_direction(i, n));
      sum += directions.back();
    }
    expect_unit(directions);
    EXPECT_LT(length(sum) / static_cast<float>(n), 1e-3f);
    // A lattice fills bins far more evenly than chance would (χ² ≈ degrees of freedom).
    const ChiSquare test = chi_square(directions, uniform_pdf);
    EXPECT_LT(test.statistic, test.freedom / 4.0) << n;
  }
}

TEST(SphereDirection, FewDirectionsAreUnitToo) {
  for (uint32_t n = 1; n <= 16; ++n) {
    for (uint32_t i = 0; i < n; ++i) EXPECT_NEAR(length(sphere_direction(i, n)), 1, 1e-6);
  }
}

TEST(SphereDirection, IntegratesSphericalHarmonics) {
  // Relighting projects radiance with these directions at equal weights: ∫Y_a·Y_b must come out as δ_ab.
  constexpr uint32_t kCount = 4096;
  constexpr int kOrder = 7, kJ = sh_count(kOrder);
  std::vector<float> y(kJ);
  std::vector<double> gram(kJ * kJ, 0);
  for (uint32_t i = 0; i < kCount; ++i) {
    sh_evaluate(kOrder, sphere_direction(i, kCount), y);
    for (size_t a = 0; a < kJ; ++a) {
      for (size_t b = 0; b < kJ; ++b)
        gram[a * kJ + b] += static_cast<double>(y[a]) * static_cast<double>(y[b]) * 2 * kTwoPi / kCount;
    }
  }
  for (size_t a = 0; a < kJ; ++a) {
    for (size_t b = 0; b < kJ; ++b) ASSERT_NEAR(gram[a * kJ + b], a == b ? 1 : 0, 2e-3) << a << " " << b;
  }
}

}  // namespace
}  // namespace lightloom
