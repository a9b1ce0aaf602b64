// Warps of the unit square, each beside its density. No libm: sampled directions end up in stored values.
#pragma once

#include <algorithm>
#include <cmath>

#include "core/base/rng.h"
#include "core/base/sh.h"
#include "core/base/vec.h"

namespace lightloom {

/// Direction about +z with density cosθ/π per steradian, from (u,v) in [0,1)².
inline Vec3 square_to_cosine_hemisphere(float u, float v) {
  const float r = std::sqrt(u);
  float s, c;
  sincos_2pi(v, &s, &c);
  return {r * c, r * s, std::sqrt(1 - u)};
}
inline float square_to_cosine_hemisphere_pdf(Vec3 d) { return d.z > 0 ? d.z / kPi : 0; }

/// Direction with density 1/(4π) per steradian.
inline Vec3 square_to_sphere(float u, float v) {
  const float z = 1 - 2 * u;
  const float r = std::sqrt(std::max(0.0f, 1 - z * z));
  float s, c;
  sincos_2pi(v, &s, &c);
  return {r * c, r * s, z};
}

/// `d` about +z, turned so that +z becomes the unit normal n.
inline Vec3 to_world(Vec3 d, Vec3 n) {
  Vec3 s, t;
  orthonormal_basis(n, &s, &t);
  return s * d.x + t * d.y + n * d.z;
}

struct Strata {
  uint32_t columns = 1, rows = 1;
};
/// n strata, as near to a square as n's divisors allow, columns ≤ rows.
inline Strata strata_of(uint32_t n) {
  uint32_t columns = static_cast<uint32_t>(std::sqrt(static_cast<double>(n)));
  while (n % columns != 0) --columns;
  return {columns, n / columns};
}
/// The least number from n on whose strata are at most twice as long as wide.
inline uint32_t well_stratified(uint32_t n) {
  while (strata_of(n).rows > 2 * strata_of(n).columns) ++n;
  return n;
}

/// Sample i of a stratified set over the unit square, jittered by `rng`.
struct Sample2 {
  float u, v;
};
inline Sample2 stratified(uint32_t i, Strata strata, Rng* rng) {
  const float below_one = 0x1.fffffep-1f;
  const float u = (static_cast<float>(i % strata.columns) + rng->next_float()) / static_cast<float>(strata.columns);
  const float v = (static_cast<float>(i / strata.columns) + rng->next_float()) / static_cast<float>(strata.rows);
  return {std::min(u, below_one), std::min(v, below_one)};
}
inline Sample2 stratified(uint32_t i, uint32_t side, Rng* rng) { return stratified(i, Strata{side, side}, rng); }

/// Side of the largest square of strata that n samples fill; the rest is left out.
inline uint32_t strata(int n) { return std::max(1u, static_cast<uint32_t>(std::sqrt(static_cast<float>(n)))); }

}  // namespace lightloom
