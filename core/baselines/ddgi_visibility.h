// How far a probe sees in every direction: the two moments of the distance, filtered, from which a receiver guesses
// whether the probe sees it, and so what the probe's word is worth.
#pragma once

#include <algorithm>
#include <cmath>
#include <span>

#include "core/base/vec.h"
#include "core/baselines/octahedral_map.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

using DistanceMap = OctahedralMap<14>;

/// Per texel, border included, {mean, mean of the square} of the distance in m, weighted by cos^50 around the texel's
/// direction, of `rays` rays that end at `farthest` at the latest. Geometry alone.
/// REQUIRES: `map` of DistanceMap::kTexels, rays > 0.
void filter_distances(const RayTracer& tracer, Vec3 probe, float farthest, uint32_t rays, std::span<Vec2> map);

/// Chebyshev's bound on the share of the probe's surroundings that lie beyond `distance`, cubed for contrast, and no
/// less than 0.05: where no probe sees a point, all of them still tell of it.
inline float chebyshev_visibility(Vec2 moments, float distance) {
  const float beyond = distance - moments.x;
  if (beyond <= 0) return 1;
  const float variance = std::abs(moments.x * moments.x - moments.y);
  const float bound = variance / (variance + beyond * beyond);
  return std::max(bound * bound * bound, 0.05f);
}

/// Weight of a probe of that visibility, `cosine` between the receiver's normal and the way to the probe, but for its place
/// in the cage: ((cosine + 1)/2)² + 0.2 times visibility, what is below 0.2 crushed.
inline float ddgi_weight(float cosine, float visibility) {
  // Smooth backface test: probes behind the surface weigh less, but are not ruled out.
  const float wrap = 0.5f * (cosine + 1);
  const float weight = std::max((wrap * wrap + 0.2f) * visibility, 1e-6f);
  // Eyes see even a little light: small weights go to 0, continuously.
  constexpr float kCrush = 0.2f;
  return weight < kCrush ? weight * weight * weight / (kCrush * kCrush) : weight;
}

}  // namespace lightloom
