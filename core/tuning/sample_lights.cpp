#include "core/tuning/sample_lights.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/rng.h"
#include "core/base/sampling.h"
#include "core/base/sh.h"

namespace lightloom {
namespace {

constexpr uint64_t kSeed = 0x7a3e;   // of nothing else
constexpr uint32_t kTries = 24;      // places per light
constexpr uint32_t kClearRays = 48;  // that measure how far a place is from any surface
constexpr float kClear = 0.2f;       // of the default spacing: far enough
constexpr float kEnclosed = 0.4f;    // share of them that must hit something
constexpr size_t kSpots = 4;         // every so many lights one is a spot
constexpr float kSpotAngle = 0.5f;   // radians from the axis

/// How good a place is for a lamp: distance to the nearest surface, `enough` at most; below 0 where most of what is around is
/// void, like outside a house whose rooms are the level.
float quality(const RayTracer& tracer, Vec3 p, float enough) {
  float nearest = enough;
  uint32_t hits = 0;
  for (uint32_t i = 0; i < kClearRays; ++i) {
    const Hit hit = tracer.closest(p, sphere_direction(i, kClearRays));
    nearest = std::min(nearest, hit.t);
    hits += static_cast<bool>(hit);
  }
  return static_cast<float>(hits) < kEnclosed * kClearRays ? nearest - 2 * enough : nearest;
}

/// Half-way, or so, from a receiver among first..end−1 to what it sees.
Vec3 place_of(const RayTracer& tracer, const Plan& ground, uint32_t first, uint32_t end, float spacing, Rng* rng) {
  const Receiver& r = ground.receivers.all[first + rng->next_below(end - first)];
  const float u = rng->next_float(), v = rng->next_float();
  const Vec3 direction = leave(r.point, square_to_cosine_hemisphere(u, v));
  const float reach = std::min(tracer.closest(r.point.position, direction).t, 4 * spacing);
  return r.point.position + direction * (reach * (0.25f + 0.5f * rng->next_float()));
}

Light light_at(const RayTracer& tracer, const Plan& ground, size_t index, size_t count) {
  const uint64_t n = ground.receivers.all.size();
  const uint32_t first = static_cast<uint32_t>(index * n / count);
  const uint32_t end = std::max(first + 1, static_cast<uint32_t>((index + 1) * n / count));
  const float spacing = default_spacing(tracer.scene().bounds()), enough = kClear * spacing;
  Rng rng(hash_combine(kSeed, index));
  Light light;
  float best = -std::numeric_limits<float>::infinity();
  for (uint32_t i = 0; i < kTries && best < enough; ++i) {
    const Vec3 place = place_of(tracer, ground, first, end, spacing, &rng);
    const float good = quality(tracer, place, enough);
    if (good > best) best = good, light.position = place;
  }
  if (index % kSpots == kSpots - 1) {
    light.type = LightType::kSpot;
    const float u = rng.next_float(), v = rng.next_float();
    light.direction = square_to_sphere(u, v);
    light.inner_cone_angle = 0.6f * kSpotAngle;
    light.outer_cone_angle = kSpotAngle;
  }
  return light;
}

float irradiance(const RayTracer& tracer, const Light& light, const ShadingPoint& p) {
  const Incident in = incident_light(light, p.position);
  const float cosine = dot(p.normal, in.to_light);
  if (!(cosine > 0) || dot(p.geometric, in.to_light) <= 0 || in.irradiance == Vec3{}) return 0;
  return tracer.occluded(p.position, in.to_light, in.distance) ? 0 : in.irradiance.x * cosine;
}

}  // namespace

absl::StatusOr<SampleLights> SampleLights::create(const RayTracer& tracer, const Plan& ground, int count,
                                                  const Parallel& how) {
  SampleLights out;
  out.lights_.resize(static_cast<size_t>(count));
  const absl::Status cancelled = absl::CancelledError("cancelled while choosing parameters");
  Parallel quiet = how;
  quiet.progress = nullptr;
  if (!parallel_for(out.lights_.size(), quiet,
                    [&](uint64_t i) { out.lights_[i] = light_at(tracer, ground, i, out.lights_.size()); })) {
    return cancelled;
  }

  const Scene& scene = tracer.scene();
  const size_t lights = out.lights_.size();
  out.radiance_.resize(ground.receivers.all.size() * lights);
  const bool done = parallel_for(ground.receivers.all.size(), quiet, [&](uint64_t i) {
    const Receiver& r = ground.receivers.all[i];
    const Texel& texel = ground.receivers.grids[r.object].texels[r.texel];
    const Object& object = scene.objects[r.object];
    const Vec3 albedo = albedo_at(scene, object, object.triangles[texel.triangle], texel.b1, texel.b2);
    const float reflected = (albedo.x + albedo.y + albedo.z) / (3 * kPi);
    for (size_t l = 0; l < lights; ++l) {
      out.radiance_[i * lights + l] = reflected * irradiance(tracer, out.lights_[l], r.point);
    }
  });
  if (!done) return cancelled;
  return out;
}

}  // namespace lightloom
