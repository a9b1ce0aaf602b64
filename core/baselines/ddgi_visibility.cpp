// Majercik, Guertin, Nowrouzezahrai, McGuire, "Dynamic Diffuse Global Illumination with Ray-Traced Irradiance Fields",
// JCGT 8(2), 2019, after Donnelly & Lauritzen, "Variance Shadow Maps", 2006; constants as in the authors' RTXGI-DDGI SDK
// (ProbeBlendingCS, Irradiance).
#include "core/baselines/ddgi_visibility.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "core/base/sh.h"

namespace lightloom {
namespace {

float power50(float x) {
  const float x2 = x * x, x3 = x2 * x, x6 = x3 * x3, x12 = x6 * x6, x25 = x12 * x12 * x;
  return x25 * x25;
}

}  // namespace

void filter_distances(const RayTracer& tracer, Vec3 probe, float farthest, uint32_t rays, std::span<Vec2> map) {
  struct Ray {
    Vec3 direction;
    float distance;
  };
  std::vector<Ray> seen;
  const Scene& scene = tracer.scene();
  for (uint32_t i = 0; i < rays; ++i) {
    const Vec3 direction = sphere_direction(i, rays);
    const Hit hit = tracer.closest(probe, direction);
    // What shows its back is made to look near (2021: a fifth of the distance), so that the probe lights nothing around
    // it. Backs that have light of their own are surfaces like others.
    const bool dark = hit && is_dark_back(scene, hit);
    seen.push_back({direction, std::min(dark ? 0.2f * hit.t : hit.t, farthest)});
  }
  for (size_t y = 0; y < 14; ++y) {
    for (size_t x = 0; x < 14; ++x) {
      const Vec3 d = DistanceMap::direction(x, y);
      Vec2 sum;
      float weight = 0;
      for (const Ray& ray : seen) {
        const float cosine = dot(d, ray.direction);
        if (cosine <= 0) continue;
        const float w = power50(cosine);
        sum = sum + Vec2{ray.distance, ray.distance * ray.distance} * w;
        weight += w;
      }
      map[DistanceMap::index(x, y)] = weight > 0 ? sum * (1 / weight) : Vec2{farthest, farthest * farthest};
    }
  }
  DistanceMap::fill_border(map);
}

}  // namespace lightloom
