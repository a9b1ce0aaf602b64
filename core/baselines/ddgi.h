// Visibility-weighted irradiance probes: dynamic diffuse global illumination (Majercik et al. 2019 and 2021), in the form
// that NVIDIA's RTXGI-DDGI SDK gives it.
//
// What differs from a game: rays are the same in every frame and many, so there is no hysteresis to blend them in time;
// distances are geometry, filtered once; a lightmap has no view, so receivers are biased along their normals alone.
#pragma once

#include <memory>

#include "core/baselines/baseline.h"

namespace lightloom {

struct DdgiParams {
  float spacing = 1;       ///< of the probes, metres
  bool enclose = false;    ///< as in make_ddgi_grid()
  float clearance = 0.2f;  ///< probes nearer than this share of the spacing to a surface are moved; 0: none is
  /// How far receivers are biased along their normals, share of the least spacing. 2021: 0.75 · 0.3, along 0.2 · normal +
  /// 0.8 · direction to the camera.
  float bias = 0.225f;
  int distance_rays = 4096;  ///< per probe
  /// Irradiance is kept to the power of 1/5, and its square roots are blended; else both are linear.
  bool perceptual = true;
  /// Receivers that never move may keep the weights of their eight probes, in place of the distance maps.
  bool keep_weights = false;
};

/// Over the box of the plan's receivers; relight rays are the plan's BakeParams::relight_rays, and nothing else is read
/// of its parameters. Errors: parameters out of range, too many probes, cancellation.
absl::StatusOr<std::unique_ptr<Baseline>> make_ddgi(const RayTracer& tracer, const Plan& plan, const DdgiParams& params,
                                                    const BakeControl& control);

}  // namespace lightloom
