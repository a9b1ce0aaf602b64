#include "core/transport/gather.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "core/base/check.h"
#include "core/base/sampling.h"
#include "core/probes/links.h"
#include "core/transport/sh_accumulator.h"

namespace lightloom {
namespace {

/// What a gather ray found.
struct Sample {
  enum Kind : uint8_t { kSurface, kSky, kDead } kind = kDead;
  Vec3 position;  // of the hit, pushed off, for kSurface
  Vec3 normal;
  Vec3 direction;  // of the ray
};

Sample shoot(const RayTracer& tracer, const ShadingPoint& from, Vec3 direction) {
  const Hit hit = tracer.closest(from.position, direction);
  if (!hit) return {Sample::kSky, {}, {}, direction};
  const Scene& scene = tracer.scene();
  const Object& object = scene.objects[hit.object];
  // Single-sided back hits block and emit nothing.
  if (hit.back && !scene.materials[object.triangles[hit.triangle].material].double_sided) return {};
  const ShadingPoint y = shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back);
  return {Sample::kSurface, y.position, y.geometric, direction};
}

/// V_i(ω) and ψ_i(ω): whether probe i sees what the sample found, and in which direction.
bool sees(const RayTracer& tracer, Vec3 probe, const Sample& s, Vec3* psi) {
  if (s.kind == Sample::kSky) {
    *psi = s.direction;
    return !tracer.occluded(probe, s.direction, std::numeric_limits<float>::infinity());
  }
  *psi = normalize(s.position - probe);
  return tracer.visible(s.position, probe);
}

/// How finely probe i resolves the surface around the hit: the solid angle of a unit of its area, cosθ/d². A probe's
/// radiance is blurred by a fixed angle, so the nearest one that looks at the hit squarely blurs it least. SL17 weighs by
/// the receiver's distance alone; this factor took the error of the Cornell box from 0.091 to 0.075 (ADR 0002).
float resolution(Vec3 probe, Vec3 psi, const Sample& s) {
  if (s.kind == Sample::kSky) return 1;
  constexpr float kGrazing = 0.05f;  // keeps weights of probes in the hit's plane finite in the quotient
  const Vec3 d = probe - s.position;
  return std::max(kGrazing, -dot(psi, s.normal)) / dot(d, d);
}

}  // namespace

GatherStats& GatherStats::operator+=(const GatherStats& o) {
  gather_rays += o.gather_rays;
  visibility_rays += o.visibility_rays;
  unseen += o.unseen;
  return *this;
}

GatherStats gather_row(const RayTracer& tracer, const GatherPoint& receiver, std::span<const Vec3> probes,
                       const GatherOptions& options, std::span<float> row) {
  const size_t J = static_cast<size_t>(sh_count(options.order));
  LL_CHECK(row.size() == probes.size() * J);
  GatherStats stats;

  // Spatial weights w_i(x) (Eq. 10). Too few probes for a support radius: all count alike.
  const size_t k = std::min(receiver.near.size(), static_cast<size_t>(options.links));
  std::array<float, 64> w;
  LL_CHECK(k <= w.size());
  const auto distance = [&](size_t n) { return length(probes[receiver.near[n]] - receiver.point.position); };
  const float radius = receiver.near.size() > k ? distance(k) : 0;
  for (size_t n = 0; n < k; ++n) w[n] = radius > 0 ? spatial_weight(distance(n) / radius) : 1.0f;

  std::vector<ShAccumulator> accumulators(receiver.near.size(), ShAccumulator(options.order));
  const uint32_t side = static_cast<uint32_t>(std::lround(std::sqrt(static_cast<double>(options.rays))));
  const uint32_t rays = side * side;
  // Cosine-weighted rays: cosθ dω becomes π ÷ rays each.
  const float per_ray = kPi / static_cast<float>(rays);
  Rng rng(receiver.seed);
  for (uint32_t r = 0; r < rays; ++r) {
    const Sample2 uv = stratified(r, side, &rng);
    const Sample sample = shoot(tracer, receiver.point, leave(receiver.point, square_to_cosine_hemisphere(uv.u, uv.v)));
    ++stats.gather_rays;
    if (sample.kind == Sample::kDead) continue;

    // K_ij = w_i·V_i·Y_j(ψ_i) ÷ Σ_k w_k·V_k (Eq. 4), the weights w_i(x) times resolution.
    std::array<Vec3, 64> psi;
    std::array<float, 64> wv;
    float sum = 0;
    for (size_t n = 0; n < k; ++n) {
      wv[n] = 0;
      if (!(w[n] > 0)) continue;
      ++stats.visibility_rays;
      const Vec3 probe = probes[receiver.near[n]];
      if (sees(tracer, probe, sample, &psi[n])) wv[n] = w[n] * resolution(probe, psi[n], sample);
      sum += wv[n];
    }
    if (sum > 0) {
      for (size_t n = 0; n < k; ++n) {
        if (wv[n] > 0) accumulators[n].add(psi[n], per_ray * (wv[n] / sum));
      }
      continue;
    }
    // No link sees it: the next-nearest probe that does.
    bool found = false;
    for (size_t n = k; n < receiver.near.size() && !found; ++n) {
      ++stats.visibility_rays;
      Vec3 direction;
      found = sees(tracer, probes[receiver.near[n]], sample, &direction);
      if (found) accumulators[n].add(direction, per_ray);
    }
    if (!found) ++stats.unseen;
  }

  for (size_t n = 0; n < receiver.near.size(); ++n) {
    accumulators[n].flush_into(row.subspan(receiver.near[n] * J, J));
  }
  return stats;
}

}  // namespace lightloom
