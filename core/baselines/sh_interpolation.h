// Plain interpolation of spherical harmonics probes: what irradiance volumes do, and what SL17 sets out to mend.
#pragma once

#include <memory>

#include "core/baselines/baseline.h"

namespace lightloom {

/// SL17 Eq. 1 with the plan's probes, links, relight rays and weights w_i (Eq. 10): no visibility, no reprojection.
/// `order`: of the irradiance; order 2, 9 coefficients, holds that of any radiance to within 1 % (Ramamoorthi and
/// Hanrahan 2001). Errors: an order out of range, a plan of another method, cancellation.
absl::StatusOr<std::unique_ptr<Baseline>> make_sh_interpolation(const RayTracer& tracer, const Plan& plan, int order,
                                                                const BakeControl& control);

}  // namespace lightloom
