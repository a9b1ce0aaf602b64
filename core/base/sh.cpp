// Spherical harmonics after Sloan, "Efficient Spherical Harmonic Evaluation", JCGT 2(2), 2013: Y_lm is a polynomial in
// z times (x + iy)^m, both by recurrence. The recurrence is written once, over a lane type that is a float or eight.
#include "core/base/sh.h"

#include <array>
#include <cmath>

#include "core/base/check.h"

namespace lightloom {
namespace {

/// Normalisation and recurrence coefficients, in double, rounded once. √ is exact to the last bit by IEEE.
struct ShTable {
  // Normalised associated Legendre without phase: p_mm, then p_{l,m} = a·z·p_{l-1,m} + b·p_{l-2,m}.
  std::array<float, kMaxShOrder + 1> diagonal{};
  std::array<std::array<float, kMaxShOrder + 1>, kMaxShOrder + 1> a{}, b{};
};

const ShTable& table() {
  static const ShTable t = [] {
    ShTable s;
    const double pi = 3.14159265358979323846;
    double k = std::sqrt(1 / (4 * pi));
    for (int m = 0; m <= kMaxShOrder; ++m) {
      if (m > 0) k *= std::sqrt((2.0 * m + 1) / (2.0 * m));
      // √2 belongs to the real basis for m > 0.
      s.diagonal[static_cast<size_t>(m)] = static_cast<float>(m == 0 ? k : k * std::sqrt(2.0));
      for (int l = m + 1; l <= kMaxShOrder; ++l) {
        const double ll = l, mm = m;
        const double norm = std::sqrt((4 * ll * ll - 1) / (ll * ll - mm * mm));
        const double previous = std::sqrt(((ll - 1) * (ll - 1) - mm * mm) / (4 * (ll - 1) * (ll - 1) - 1));
        s.a[static_cast<size_t>(l)][static_cast<size_t>(m)] = static_cast<float>(norm);
        s.b[static_cast<size_t>(l)][static_cast<size_t>(m)] = static_cast<float>(-norm * previous);
      }
    }
    return s;
  }();
  return t;
}

using Lanes [[gnu::vector_size(kShLanes * sizeof(float))]] = float;

template <class Lane, class Store>
void evaluate(int order, Lane x, Lane y, Lane z, Store store) {
  const ShTable& t = table();
  Lane c = x * 0.0f + 1.0f, s = x * 0.0f;  // Re and Im of (x + iy)^m
  for (int m = 0; m <= order; ++m) {
    const size_t um = static_cast<size_t>(m);
    Lane p2 = x * 0.0f, p1 = x * 0.0f + t.diagonal[um];
    for (int l = m; l <= order; ++l) {
      if (l > m) {
        const size_t ul = static_cast<size_t>(l);
        const Lane p = t.a[ul][um] * z * p1 + t.b[ul][um] * p2;
        p2 = p1;
        p1 = p;
      }
      store(l * (l + 1) + m, p1 * c);
      if (m > 0) store(l * (l + 1) - m, p1 * s);
    }
    const Lane next = c * x - s * y;
    s = s * x + c * y;
    c = next;
  }
}

}  // namespace

void sh_evaluate(int order, Vec3 d, std::span<float> out) {
  LL_CHECK(order >= 0 && order <= kMaxShOrder && out.size() >= static_cast<size_t>(sh_count(order)));
  evaluate(order, d.x, d.y, d.z, [&](int j, float v) { out[static_cast<size_t>(j)] = v; });
}

void sh_evaluate_lanes(int order, const float* x, const float* y, const float* z, float* out) {
  Lanes vx, vy, vz;
  for (int i = 0; i < kShLanes; ++i) {
    vx[i] = x[i];
    vy[i] = y[i];
    vz[i] = z[i];
  }
  evaluate(order, vx, vy, vz, [&](int j, const Lanes& v) {
    for (int i = 0; i < kShLanes; ++i) out[j * kShLanes + i] = v[i];
  });
}

void sincos_2pi(float u, float* sine, float* cosine) {
  // Quarter turns are exact; within an eighth of a turn the Taylor series to x^9 is below float rounding.
  const double turns = static_cast<double>(u) * 4;
  const double quarter = std::floor(turns + 0.5);
  const double x = (turns - quarter) * 1.57079632679489661923;
  const double x2 = x * x;
  const double s = x * (1 - x2 / 6 * (1 - x2 / 20 * (1 - x2 / 42 * (1 - x2 / 72 * (1 - x2 / 110)))));
  const double c = 1 - x2 / 2 * (1 - x2 / 12 * (1 - x2 / 30 * (1 - x2 / 56 * (1 - x2 / 90))));
  switch (static_cast<int>(quarter) & 3) {
    case 0:
      *sine = static_cast<float>(s), *cosine = static_cast<float>(c);
      break;
    case 1:
      *sine = static_cast<float>(c), *cosine = static_cast<float>(-s);
      break;
    case 2:
      *sine = static_cast<float>(-s), *cosine = static_cast<float>(-c);
      break;
    default:
      *sine = static_cast<float>(-c), *cosine = static_cast<float>(s);
      break;
  }
}

Vec3 sphere_direction(uint32_t i, uint32_t n) {
  const double z = 1 - (2.0 * i + 1) / n;
  const double golden = 0.61803398874989484820;  // 1/φ
  const double turn = i * golden - std::floor(i * golden);
  float s, c;
  sincos_2pi(static_cast<float>(turn), &s, &c);
  const double r = std::sqrt(1 - z * z);
  return {static_cast<float>(r * c), static_cast<float>(r * s), static_cast<float>(z)};
}

std::vector<float> sh_uniform(int order, uint32_t n) {
  const size_t J = static_cast<size_t>(sh_count(order));
  std::vector<double> sum(J, 0.0);
  std::array<float, kMaxShCount> basis;
  for (uint32_t r = 0; r < n; ++r) {
    sh_evaluate(order, sphere_direction(r, n), basis);
    for (size_t j = 1; j < J; ++j) sum[j] += static_cast<double>(basis[j]);
  }
  std::vector<float> u(J);
  u[0] = kShUniform;
  for (size_t j = 1; j < J; ++j) u[j] = n > 0 ? static_cast<float>(sum[j] * (4 * 3.14159265358979323846 / n)) : 0.0f;
  return u;
}

}  // namespace lightloom
