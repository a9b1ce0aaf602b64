// Lights to try a model with, where no artist has put any yet: points and spots in the level's own open space.
#pragma once

#include <span>
#include <vector>

#include "core/bake/plan.h"

namespace lightloom {

class SampleLights {
 public:
  /// `count` lights of the level's own choosing: spread over what has receivers, each half-way to what one of them sees, and
  /// not next to a surface where that can be helped. The same for every spacing of probes. Error: cancellation.
  static absl::StatusOr<SampleLights> create(const RayTracer& tracer, const Plan& ground, int count,
                                             const Parallel& how);

  size_t count() const { return lights_.size(); }
  const std::vector<Light>& lights() const { return lights_; }
  /// Reflected radiance of a receiver of the ground by each light, one channel, from a ray from its middle to the light.
  std::span<const float> radiance(uint32_t receiver) const {
    return std::span(radiance_).subspan(receiver * lights_.size(), lights_.size());
  }

 private:
  std::vector<Light> lights_;
  std::vector<float> radiance_;  // receivers × lights
};

}  // namespace lightloom
