// Lights to try a model with, where no artist has put any yet: lamps in the level's own open space and close to its surfaces, spots,
// and suns that find a way in.
#pragma once

#include <span>
#include <vector>

#include "core/bake/plan.h"

namespace lightloom {

class SampleLights {
 public:
  /// `count` lights of the level's own choosing, spread over what has receivers. Of each eight, four are lamps about half-way to
  /// what a receiver sees, and not next to a surface where that can be helped; two are lamps that hang close to a receiver; one is
  /// a spot; one is a sun that reaches a receiver, or a lamp where none can. The same for every spacing of probes. Error:
  /// cancellation.
  static absl::StatusOr<SampleLights> create(const RayTracer& tracer, const Plan& ground, int count,
                                             const Parallel& how);

  size_t count() const { return lights_.size(); }
  const std::vector<Light>& lights() const { return lights_; }
  /// Reflected radiance of a receiver of the ground by each light, one channel, from rays from a few of its points to the light.
  std::span<const float> radiance(uint32_t receiver) const {
    return std::span(radiance_).subspan(receiver * lights_.size(), lights_.size());
  }
  /// The same where a ray has hit something, instead of the mean over a texel; out: by light. REQUIRES: not single-sided from
  /// behind.
  void radiance_at(const RayTracer& tracer, const Hit& hit, std::span<float> out) const;

 private:
  std::vector<Light> lights_;
  std::vector<float> radiance_;  // receivers × lights
};

}  // namespace lightloom
