#include "core/base/half.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "core/base/rng.h"

namespace lightloom {
namespace {

/// What IEEE 754 says a half is worth.
double value_of(uint32_t h) {
  const double sign = h & 0x8000 ? -1 : 1;
  const int exponent = static_cast<int>(h >> 10 & 31);
  const double mantissa = h & 1023;
  return exponent == 0 ? sign * std::ldexp(mantissa, -24) : sign * std::ldexp(1024 + mantissa, exponent - 25);
}

/// Nearest half by bisection over the ordered positive halfs, ties to the even one, ±65504 beyond.
Half slow_float_to_half(float f) {
  const double magnitude = std::abs(static_cast<double>(f));
  const uint32_t sign = std::signbit(f) ? 0x8000 : 0;
  uint32_t lo = 0, hi = 0x7bff;
  if (magnitude >= value_of(hi)) return static_cast<Half>(sign | hi);
  while (hi - lo > 1) {
    const uint32_t middle = (lo + hi) / 2;
    (value_of(middle) <= magnitude ? lo : hi) = middle;
  }
  const double below = magnitude - value_of(lo), above = value_of(hi) - magnitude;
  const uint32_t nearest = below < above || (below == above && lo % 2 == 0) ? lo : hi;
  return static_cast<Half>(sign | nearest);
}

TEST(Half, AllHalfsRoundTrip) {
  for (uint32_t h = 0; h < 65536; ++h) {
    const float f = half_to_float(static_cast<Half>(h));
    if ((h & 0x7c00) == 0x7c00) {
      // Infinities saturate; NaNs stay NaNs.
      EXPECT_EQ(std::isnan(f), (h & 0x3ff) != 0) << h;
      EXPECT_EQ(std::isinf(f), (h & 0x3ff) == 0) << h;
      const Half back = float_to_half(f);
      if (std::isnan(f)) {
        EXPECT_TRUE(std::isnan(half_to_float(back))) << h;
      } else {
        EXPECT_EQ(back, h & 0x8000 ? 0xfbff : 0x7bff);
      }
      continue;
    }
    ASSERT_EQ(static_cast<double>(f), value_of(h)) << h;
    ASSERT_EQ(std::signbit(f), (h & 0x8000) != 0) << h;
    ASSERT_EQ(float_to_half(f), h);
  }
}

TEST(Half, RoundsToNearestEvenAtEveryMidpoint) {
  for (uint32_t h = 0; h < 0x7bff; ++h) {
    const float middle = static_cast<float>((value_of(h) + value_of(h + 1)) / 2);  // exact in float
    for (const float f : {std::nextafter(middle, 0.0f), middle, std::nextafter(middle, 1e9f)}) {
      ASSERT_EQ(float_to_half(f), slow_float_to_half(f)) << h << " " << f;
      ASSERT_EQ(float_to_half(-f), slow_float_to_half(-f)) << h << " " << f;
    }
  }
}

TEST(Half, AgreesWithTheOracleOnRandomFloats) {
  Rng rng(1);
  for (int i = 0; i < 500000; ++i) {
    // Half of them in the range of halfs, where random bits seldom fall.
    const uint32_t bits = rng.next_u32();
    const float f = i % 2 ? std::bit_cast<float>(bits) : std::bit_cast<float>((bits & 0x8fffffffu) + 0x30000000u);
    if (std::isnan(f)) continue;
    ASSERT_EQ(float_to_half(f), slow_float_to_half(f)) << f;
  }
}

TEST(Half, Saturates) {
  const float inf = std::numeric_limits<float>::infinity();
  for (const float f : {65504.0f, 65519.99f, 65520.0f, 65536.0f, 1e30f, inf}) {
    EXPECT_EQ(float_to_half(f), 0x7bff) << f;
    EXPECT_EQ(float_to_half(-f), 0xfbff) << f;
  }
  EXPECT_EQ(float_to_half(65487.0f), 0x7bfe);
  EXPECT_EQ(float_to_half(0x1p-25f), 0) << "half the smallest, ties to even";
  EXPECT_EQ(float_to_half(0x1.000002p-25f), 1);
  EXPECT_EQ(float_to_half(-0.0f), 0x8000);
}

}  // namespace
}  // namespace lightloom
