// Real orthonormal spherical harmonics, and the directions that probes look along. Both are part of what stored
// coefficients mean, so both are polynomials and IEEE operations only: the same bits on every machine.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/vec.h"

namespace lightloom {

inline constexpr int kMaxShOrder = 9;
inline constexpr int kMaxShCount = (kMaxShOrder + 1) * (kMaxShOrder + 1);

/// J: number of coefficients of order n (bands 0..n). SL17 calls n = 7 "order 7": J = 64.
constexpr int sh_count(int order) { return (order + 1) * (order + 1); }
/// J rounded up to 8, the stride of a probe's coefficients in assets and on the GPU (16-byte rows of fp16).
constexpr int sh_stride(int order) { return (sh_count(order) + 7) / 8 * 8; }

/// Y_0 = 1/√(4π), and √(4π): the coefficient of the uniform radiance field 1.
inline constexpr float kShDc = 0.28209479177387814f;
inline constexpr float kShUniform = 3.5449077018110321f;
inline constexpr float kPi = 3.14159265358979323846f;

/// out[l·(l+1)+m] = Y_lm(d) for l ≤ order, Condon–Shortley phase left out (Y_1 = √(3/4π)·(y, z, x)).
/// REQUIRES: d unit, order ≤ kMaxShOrder, out.size() ≥ sh_count(order).
void sh_evaluate(int order, Vec3 d, std::span<float> out);

/// The same for kShLanes directions at once: out[j·kShLanes + lane]. Bit-identical to sh_evaluate.
inline constexpr int kShLanes = 8;
void sh_evaluate_lanes(int order, const float* x, const float* y, const float* z, float* out);

/// cos(2πu), sin(2πu) for u in [0,1], absolute error below 2e-7.
void sincos_2pi(float u, float* sine, float* cosine);

/// Direction i of n equal-area directions on the sphere (spherical Fibonacci lattice; Keinert et al. 2015).
Vec3 sphere_direction(uint32_t i, uint32_t n);

/// What the uniform radiance field 1 becomes when a probe projects it with n relight rays: u_j = 4π/n·Σ_r Y_j(ω_r),
/// √(4π) for j = 0 and the lattice's quadrature error elsewhere. n = 0: without that error.
std::vector<float> sh_uniform(int order, uint32_t n);

}  // namespace lightloom
