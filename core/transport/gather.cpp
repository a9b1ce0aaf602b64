#include "core/transport/gather.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "core/base/check.h"
#include "core/base/sampling.h"
#include "core/probes/links.h"

namespace lightloom {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// How finely a probe resolves the surface around the hit: the solid angle of a unit of its area, cosθ/d². A probe's
/// radiance is blurred by a fixed angle, so the nearest one that looks at the hit squarely blurs it least. SL17 weighs by
/// the receiver's distance alone; this factor took the error of the Cornell box from 0.091 to 0.075 (ADR 0002).
float resolution(Vec3 to_probe, Vec3 psi, Vec3 normal) {
  constexpr float kGrazing = 0.05f;  // keeps weights of probes in the hit's plane finite in the quotient
  return std::max(kGrazing, -dot(psi, normal)) / dot(to_probe, to_probe);
}

}  // namespace

GatherRay gather_ray(const GatherPoint& receiver, uint32_t r, Strata strata, Rng* rng) {
  const Sample2 uv = stratified(r, strata, rng);
  const ShadingPoint& from = receiver.from[(r % strata.columns + r / strata.columns) % receiver.from.size()];
  return {from.position, leave(from, square_to_cosine_hemisphere(uv.u, uv.v))};
}

GatherStats& GatherStats::operator+=(const GatherStats& o) {
  gather_rays += o.gather_rays;
  visibility_rays += o.visibility_rays;
  unseen += o.unseen;
  return *this;
}

Gatherer::Gatherer(const RayTracer& tracer, VisibilityCache* cache, const ReceiverSearch* surfaces, GatherProbes probes,
                   const GatherOptions& options, TraceRecorder* recorder)
    : tracer_(tracer),
      cache_(cache),
      surfaces_(surfaces),
      recorder_(recorder),
      probes_(probes),
      options_(options),
      accumulator_(options.order) {
  LL_CHECK(surfaces != nullptr || options.near_field == 0);
}

Gatherer::Sample Gatherer::trace(const GatherRay& ray) {
  ++stats_.gather_rays;
  const Hit hit = tracer_.closest(ray.origin, ray.direction);
  Sample s;
  s.direction = ray.direction;
  if (!hit) {
    s.kind = Sample::kSky;
    if (recorder_ != nullptr) s.place = recorder_->sky(ray.direction);
    return s;
  }
  const Scene& scene = tracer_.scene();
  const Object& object = scene.objects[hit.object];
  const ShadingPoint y = shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back);
  float reach = 0;
  if (!is_dark_back(scene, hit)) {
    s.kind = Sample::kSurface;
    s.position = y.position;
    s.normal = y.geometric;
    if (hit.t < options_.near_field) {
      const uint32_t texel = surfaces_->locate(hit, &reach);
      if (texel != Receivers::kNone) {
        s.texel = texel;
        s.distance = hit.t;
      }
    }
    if ((s.texel == Receivers::kNone || options_.rings) && cache_ != nullptr) {
      float of_patch = 0;
      s.patch = cache_->patch_of(hit, y, &of_patch);
      reach = std::max(reach, of_patch);
    }
  }
  if (recorder_ != nullptr) s.place = recorder_->hit(y.position, reach);
  return s;
}

/// Adds up the rays of each texel.
void Gatherer::find_near(float from, float to) {
  near_.clear();
  for (const Sample& s : samples_) {
    if (s.distance >= from && s.distance < to) near_.push_back({s.texel, 1});
  }
  std::sort(near_.begin(), near_.end(), [](const NearTexel& a, const NearTexel& b) { return a.receiver < b.receiver; });
  size_t kept = 0;
  for (size_t i = 0; i < near_.size(); ++i) {
    if (kept > 0 && near_[kept - 1].receiver == near_[i].receiver) {
      ++near_[kept - 1].rays;
    } else {
      near_[kept++] = near_[i];
    }
  }
  near_.resize(kept);
}

/// V_i(ω) and ψ_i(ω): whether the probe sees what the sample found, and in which direction.
bool Gatherer::sees(uint32_t probe, const Sample& s, Vec3* psi) {
  const Vec3 p = probes_.positions[probe];
  if (recorder_ != nullptr) recorder_->ask(s.place, probe);
  const bool sky = s.kind == Sample::kSky;
  auto verdict = VisibilityCache::kSplit;
  if (s.patch != VisibilityCache::kNoPatch) {
    verdict = cache_->find(s.patch, probes_.ids[probe], &stats_.visibility_rays);
  } else if (sky && cache_ != nullptr) {
    verdict = cache_->find_sky(s.direction, probes_.ids[probe], &stats_.visibility_rays);
  }
  if (verdict == VisibilityCache::kHidden) return false;
  *psi = sky ? s.direction : normalize(s.position - p);
  if (verdict == VisibilityCache::kSeen) return true;
  ++stats_.visibility_rays;
  return sky ? !tracer_.occluded(p, s.direction, kInfinity) : tracer_.visible(s.position, p);
}

GatherStats Gatherer::add_row(const GatherPoint& receiver, std::span<float> row) {
  shoot(receiver);
  find_near(0, options_.near_field);
  return add_far(options_.near_field, kInfinity, row);
}

GatherStats Gatherer::add_ring(float from, float to, std::span<float> row) {
  LL_CHECK(options_.rings && receiver_ != nullptr);
  find_near(from, to);
  return add_far(from, to, row);
}

void Gatherer::shoot(const GatherPoint& receiver) {
  LL_CHECK(!receiver.from.empty() && receiver.links <= receiver.near.size());
  receiver_ = &receiver;
  stats_ = {};
  if (recorder_ != nullptr) {
    Aabb origin;
    for (const ShadingPoint& from : receiver.from) origin.extend(from.position);
    recorder_->from(origin);
  }

  // Spatial weights w_i(x) (Eq. 10).
  spatial_.resize(receiver.links);
  for (uint32_t n = 0; n < receiver.links; ++n) {
    const float distance = length(probes_.positions[receiver.near[n]] - receiver.point.position);
    spatial_[n] = receiver.radius > 0 ? spatial_weight(distance / receiver.radius) : 1.0f;
  }

  const uint32_t rays = static_cast<uint32_t>(options_.rays);
  const Strata strata = strata_of(rays);
  Rng rng(receiver.seed);
  samples_.clear();
  for (uint32_t r = 0; r < rays; ++r) {
    samples_.push_back(trace(gather_ray(receiver, r, strata, &rng)));
  }
}

/// Rays at infinity are those that no near field has, whatever their length.
GatherStats Gatherer::add_far(float from, float to, std::span<float> row) {
  const GatherPoint& receiver = *receiver_;
  const size_t J = static_cast<size_t>(sh_count(options_.order));
  LL_CHECK(row.size() == probes_.positions.size() * J);
  const uint32_t near = static_cast<uint32_t>(receiver.near.size()), rays = static_cast<uint32_t>(options_.rays);

  // K_ij = w_i·V_i·Y_j(ψ_i) ÷ Σ_k w_k·V_k (Eq. 4), the weights w_i(x) perhaps times resolution.
  if (sights_.size() < near) sights_.resize(near);
  for (auto& sights : sights_) sights.clear();
  sum_.assign(rays, 0);
  for (uint32_t r = 0; r < rays; ++r) {
    const Sample& s = samples_[r];
    if (s.kind == Sample::kDead || s.distance < from || (s.distance >= to && to < kInfinity)) continue;
    for (uint32_t n = 0; n < receiver.links; ++n) {
      Vec3 psi;
      if (!(spatial_[n] > 0) || !sees(receiver.near[n], s, &psi)) continue;
      float w = spatial_[n];
      if (options_.weigh_by_resolution && s.kind == Sample::kSurface) {
        w *= resolution(s.position - probes_.positions[receiver.near[n]], psi, s.normal);
      }
      sights_[n].push_back({r, w, psi});
      sum_[r] += w;
    }
    // No link sees it: the next-nearest probe that does.
    for (uint32_t n = receiver.links; n < near && !(sum_[r] > 0); ++n) {
      Vec3 psi;
      if (!sees(receiver.near[n], s, &psi)) continue;
      sights_[n].push_back({r, 1, psi});
      sum_[r] = 1;
    }
    if (!(sum_[r] > 0)) ++stats_.unseen;
  }

  // α_ij = ∫ K_ij cosθ dω (Eq. 7). Cosine-weighted rays: cosθ dω becomes π ÷ rays each.
  const float per_ray = kPi / static_cast<float>(rays);
  for (uint32_t n = 0; n < near; ++n) {
    for (const Sight& sight : sights_[n]) {
      accumulator_.add(sight.psi, per_ray * (sight.weight / sum_[sight.sample]));
    }
    accumulator_.flush_into(row.subspan(receiver.near[n] * J, J));
  }
  return std::exchange(stats_, {});
}

}  // namespace lightloom
