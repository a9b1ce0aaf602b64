// What probes see along the same fixed directions, and linear functionals of it.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/bake/plan.h"

namespace lightloom {

/// The surface element at the end of every relight ray, as bake_relight() finds it. Ray r of every probe looks along
/// sphere_direction(r, count()).
class RelightRays {
 public:
  /// Rays per probe: the plan's BakeParams::relight_rays. Error: cancellation.
  static absl::StatusOr<RelightRays> trace(const RayTracer& tracer, const Plan& plan, std::span<const Vec3> probes,
                                           const BakeControl& control);

  uint32_t count() const { return count_; }
  size_t probes() const { return count_ == 0 ? 0 : elements_.size() / count_; }
  /// As stored: 4 bytes a ray.
  uint64_t bytes() const { return elements_.size() * sizeof(uint32_t); }
  /// Index into Receivers::all per ray; or sky(); or sky() + 1: black.
  std::span<const uint32_t> of(uint32_t probe) const {
    return std::span(elements_).subspan(uint64_t{probe} * count_, count_);
  }
  uint32_t sky() const { return sky_; }

  /// out[c·stride + k] = Σ_r weights[r·stride + k] · L_r, channel c, with L_r = radiance[of(probe)[r]].
  /// REQUIRES: stride a multiple of 8; weights of count() × stride, radiance of sky() + 2, out of 3 × stride.
  void project(uint32_t probe, std::span<const Vec3> radiance, std::span<const float> weights, size_t stride,
               std::span<float> out) const;

 private:
  uint32_t count_ = 0, sky_ = 0;
  std::vector<uint32_t> elements_;  ///< probes × count
};

}  // namespace lightloom
