// Affine maps in double: a level may lie far from the origin, and float only sees world space.
#pragma once

#include <array>
#include <cmath>

#include "core/base/vec.h"
#include "core/scene/scene.h"

namespace lightloom {

using Dvec3 = std::array<double, 3>;

inline constexpr Transform kIdentity{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};

/// a ∘ b. The bottom rows are taken to be (0, 0, 0, 1).
inline Transform compose(const Transform& a, const Transform& b) {
  Transform c = kIdentity;
  for (size_t column = 0; column < 4; ++column) {
    for (size_t row = 0; row < 3; ++row) {
      double sum = column == 3 ? a[12 + row] : 0;
      for (size_t k = 0; k < 3; ++k) sum += a[4 * k + row] * b[4 * column + k];
      c[4 * column + row] = sum;
    }
  }
  return c;
}

inline Dvec3 transform_point(const Transform& m, Dvec3 p) {
  Dvec3 out{};
  for (size_t row = 0; row < 3; ++row) {
    out[row] = m[row] * p[0] + m[4 + row] * p[1] + m[8 + row] * p[2] + m[12 + row];
  }
  return out;
}

/// The cofactors of the linear part: det(M) · M⁻ᵀ, which turns normals and exists for singular M too.
/// Column-major 3×3.
inline std::array<double, 9> cofactors(const Transform& m) {
  const auto cross = [&](size_t a, size_t b) {
    return Dvec3{m[a + 1] * m[b + 2] - m[a + 2] * m[b + 1], m[a + 2] * m[b] - m[a] * m[b + 2],
                 m[a] * m[b + 1] - m[a + 1] * m[b]};
  };
  const Dvec3 x = cross(4, 8), y = cross(8, 0), z = cross(0, 4);
  return {x[0], x[1], x[2], y[0], y[1], y[2], z[0], z[1], z[2]};
}

inline double determinant(const Transform& m) {
  const std::array<double, 9> c = cofactors(m);
  return m[0] * c[0] + m[1] * c[1] + m[2] * c[2];
}

/// REQUIRES: determinant(m) != 0
inline Transform inverse(const Transform& m) {
  const std::array<double, 9> c = cofactors(m);
  const double det = determinant(m);
  Transform out = kIdentity;
  for (size_t column = 0; column < 3; ++column) {
    for (size_t row = 0; row < 3; ++row) out[4 * column + row] = c[3 * row + column] / det;
  }
  for (size_t row = 0; row < 3; ++row) {
    out[12 + row] = -(out[row] * m[12] + out[4 + row] * m[13] + out[8 + row] * m[14]);
  }
  return out;
}

/// Zero if `v` has no direction. What is unit up to float rounding stays bit for bit, so that saving a level
/// and loading it again changes nothing.
inline Vec3 unit(Dvec3 v) {
  const double square = v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
  if (!(square > 0) || !std::isfinite(square)) return {};
  const double length = std::abs(square - 1) < 3e-7 ? 1 : std::sqrt(square);
  return {static_cast<float>(v[0] / length), static_cast<float>(v[1] / length), static_cast<float>(v[2] / length)};
}

}  // namespace lightloom
