// How far the light that a receiver gets can be from what its probes make of it, over all lighting.
//
// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse Radiance Probes", TOG
// 36(6), 2017, Sec. 5.2. A receiver's incident radiance, an SH vector λ_x of order 9, is projected to the probes and back, and
// the irradiance of what returns is compared with its own (Eq. 12):
//
//   error²(x; λ_x) = ‖⟨cosθ, (I − P_x P*) λ_x⟩‖².
//
// P* is P_x with exchanged parts: probe i receives, along each of its rays ω, what the receiver, as the only probe, sees of the
// same surface point Γ(p_i, ω); zero if it does not see it:
//
//   (P* λ_x)_ij = ∫ Y_j(ω) V_x(Γ(p_i, ω)) Σ_l λ_x,l Y_l(ψ_x(Γ(p_i, ω))) dω.
//
// The operator maps vectors to one number, so it is a vector m of 100 entries, and its norm is ‖m‖: the largest error of any
// unit λ_x, and ten times the root mean square of all. It is given in units of ‖cosθ‖ = √(2π/3): 1 is to get nothing of the light.
#pragma once

#include <span>
#include <vector>

#include "core/bake/plan.h"

namespace lightloom {

/// √(‖m‖² ÷ (2π/3)) for each of `receivers`, indices into the plan's, by the plan's probes, order and weights; without rank, fp16
/// and the noise of rays. The near field loses nothing. m is measured by four sets of rays, and the variance between them taken off; what comes out below zero
/// is 0. Directions in which a receiver sees back faces that emit nothing take no part: no light comes from there. Deterministic.
/// Error: cancellation.
absl::StatusOr<std::vector<double>> operator_norms(const RayTracer& tracer, const Plan& plan,
                                                   std::span<const uint32_t> receivers, const Parallel& how);

}  // namespace lightloom
