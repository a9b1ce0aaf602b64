// Inside or outside: do the rays that leave a point meet fronts or backs first?
#pragma once

#include <cstdint>

#include "core/receivers/surface_point.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// First hits of a set of rays.
struct FirstHits {
  int rays = 0, hits = 0, backs = 0;
  float nearest = std::numeric_limits<float>::infinity();  ///< metres

  void add(const Hit& hit) {
    ++rays;
    if (!hit) return;
    ++hits;
    if (hit.back) ++backs;
    nearest = std::min(nearest, hit.t);
  }
  /// For points anywhere: what a level's shell hides from them does not speak for them, so misses do not count.
  bool solid() const { return hits > 0 && 2 * backs >= hits; }
};

enum class Space : uint8_t {
  kOpen,
  kSolid,  ///< at least half of the rays meet a back first; misses are open: a canopy over open ground is no solid
  kVoid,   ///< fewer than an eighth of the rays hit anything
};

/// Decides by up to 36 cosine-weighted rays. `seed` names the point.
Space classify(const RayTracer& tracer, const ShadingPoint& point, uint64_t seed);

/// Whether nothing stands between two points of surfaces that look the same way. Surfaces that bend hide their own points
/// from each other: there a way above them will do, kDetour of the distance higher than either.
bool joined(const RayTracer& tracer, const ShadingPoint& a, const ShadingPoint& b);
inline constexpr float kDetour = 0.5f;  // over an edge between faces 60° apart it takes a third

}  // namespace lightloom
