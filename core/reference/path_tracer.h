// The yardstick: brute-force path tracing of the irradiance that the bake approximates.
//
// E(x) is all light that reaches x except that arriving straight from punctual lights: everything reflected at least
// once, plus emission and sky. With `bounces` = N, light is reflected at up to N surfaces on its way to x.
#pragma once

#include <cstdint>
#include <string_view>

#include "core/base/parallel.h"
#include "core/base/sampling.h"
#include "core/receivers/layout.h"
#include "core/receivers/surface_point.h"
#include "core/receivers/texels.h"
#include "core/scene/image.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// Changes with any change of E beyond noise, or of the noise: what is remembered of the truth does not hold then.
inline constexpr std::string_view kReferenceVersion = "1";

struct ReferenceOptions {
  int bounces = 1;
  int samples = 1024;  ///< paths per texel or pixel; half of them with each of two seeds
  uint64_t seed = 1;
  Footprint footprint = Footprint::kTexel;
  Parallel parallel;
};

struct ReferenceResult {
  /// R, G, B: E, W/m² (π included); A: 1 where the texel's centre is covered; area: m² in the texel.
  Image image;
  /// ‖E₁ − E₂‖ ÷ (2‖E‖) over valid texels, E₁ and E₂ from the two seeds: the image's own noise in rel_rmse units.
  double noise = 0;
};

/// E per front-side texel in the image layout, averaged over the texel by its footprint.
absl::StatusOr<ReferenceResult> reference_lightmap(const RayTracer& tracer, const AtlasLayout& layout,
                                                   const ReferenceOptions& options);

/// E at the first hit of each pixel of a camera, height = width ÷ aspect; A: 1 where the ray hits.
absl::StatusOr<ReferenceResult> reference_camera(const RayTracer& tracer, const Camera& camera, int width,
                                                 const ReferenceOptions& options);

/// Radiance arriving at `origin` from `direction` by one random path, without what punctual lights send straight.
Vec3 trace_path(const RayTracer& tracer, Vec3 origin, Vec3 direction, int bounces, Rng* rng);

/// Irradiance at a point straight from the scene's punctual lights, shadowed, W/m².
Vec3 direct_irradiance(const RayTracer& tracer, const ShadingPoint& point);

/// Direction of the ray through (x, y) in [0,1]² of the image, row 0 at the top; unit.
Vec3 camera_direction(const Camera& camera, float x, float y);

}  // namespace lightloom
