#include "core/tuning/sample_lights.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "core/base/rng.h"
#include "core/base/sampling.h"
#include "core/base/sh.h"
#include "core/receivers/texel_opening.h"
#include "core/tuning/receiver_sample.h"

namespace lightloom {
namespace {

constexpr uint64_t kSeed = 0x7a3e;   // of nothing else
constexpr uint32_t kTries = 24;      // places per light
constexpr uint32_t kClearRays = 48;  // that measure how far a place is from any surface
constexpr float kClear = 0.2f;       // of the default spacing: far enough
constexpr float kEnclosed = 0.4f;    // share of them that must hit something
constexpr size_t kPoints = 4;        // of a texel, that its radiance is the mean of, at most
constexpr float kSpotAngle = 0.5f;   // radians from the axis
// A light of less than this share of the middle one's energy (of what is reflected to receivers) is replaced, if substitutes
// have more: most of its light leaves the level, or stays in a corner.
constexpr double kWasted = 0.1;
constexpr size_t kLookingReceivers = 1024;  // that tell
constexpr uint32_t kLooks = 8;              // rays of each

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

/// Towards the sky from a receiver among first..end−1; zero if none was found that sees it.
Vec3 to_sky(const RayTracer& tracer, const Plan& ground, uint32_t first, uint32_t end, Rng* rng) {
  for (uint32_t i = 0; i < 8 * kTries; ++i) {
    const Receiver& r = ground.receivers.all[first + rng->next_below(end - first)];
    const float u = rng->next_float(), v = rng->next_float();
    const Vec3 direction = leave(r.point, square_to_cosine_hemisphere(u, v));
    if (direction.y > 0 && !tracer.occluded(r.point.position, direction, std::numeric_limits<float>::infinity())) {
      return direction;
    }
  }
  return {};
}

enum class Kind { kOpen, kClose, kSpot, kSun };
constexpr Kind kKinds[] = {Kind::kOpen, Kind::kClose, Kind::kOpen, Kind::kSpot,
                           Kind::kOpen, Kind::kClose, Kind::kOpen, Kind::kSun};

/// In its part of the level, at first; other attempts are made anywhere.
Light light_at(const RayTracer& tracer, const Plan& ground, size_t index, size_t count, uint64_t attempt) {
  const uint64_t n = ground.receivers.all.size();
  const uint32_t first = attempt > 0 ? 0 : static_cast<uint32_t>(index * n / count);
  const uint32_t end = std::max(first + 1, static_cast<uint32_t>(attempt > 0 ? n : (index + 1) * n / count));
  const float spacing = default_spacing(tracer.scene().bounds()), enough = kClear * spacing;
  const Kind kind = kKinds[index % std::size(kKinds)];
  Rng rng(hash_combine(kSeed + attempt, index));
  Light light;
  if (kind == Kind::kSun) {
    light.direction = -to_sky(tracer, ground, first, end, &rng);
    light.type = LightType::kDirectional;
    if (light.direction != Vec3{}) return light;
    light.type = LightType::kPoint;
  }
  if (kind == Kind::kClose) {
    const Receiver& r = ground.receivers.all[first + rng.next_below(end - first)];
    const float reach = tracer.closest(r.point.position, r.point.geometric).t;
    light.position =
        r.point.position + r.point.geometric * std::min(spacing * (0.1f + 0.2f * rng.next_float()), 0.5f * reach);
    return light;
  }
  float best = -std::numeric_limits<float>::infinity();
  for (uint32_t i = 0; i < kTries && best < enough; ++i) {
    const Vec3 place = place_of(tracer, ground, first, end, spacing, &rng);
    const float good = quality(tracer, place, enough);
    if (good > best) best = good, light.position = place;
  }
  if (kind == Kind::kSpot) {
    light.type = LightType::kSpot;
    const float u = rng.next_float(), v = rng.next_float();
    light.direction = square_to_sphere(u, v);
    light.inner_cone_angle = 0.6f * kSpotAngle;
    light.outer_cone_angle = kSpotAngle;
    light.intensity = 2 / (1 - std::cos(kSpotAngle));  // as much light as the others
  }
  return light;
}

float irradiance(const RayTracer& tracer, const Light& light, const ShadingPoint& p) {
  const Incident in = incident_light(light, p.position);
  const float cosine = dot(p.normal, in.to_light);
  if (!(cosine > 0) || dot(p.geometric, in.to_light) <= 0 || in.irradiance == Vec3{}) return 0;
  return tracer.occluded(p.position, in.to_light, in.distance) ? 0 : in.irradiance.x * cosine;
}

/// What a few receivers see along a few rays each.
std::vector<std::vector<ShadingPoint>> seen_by(const RayTracer& tracer, const Plan& ground,
                                               std::span<const uint32_t> receivers) {
  std::vector<std::vector<ShadingPoint>> out;
  for (const uint32_t r : receivers) {
    const ShadingPoint& from = ground.receivers.all[r].point;
    Rng rng(hash_combine(kSeed, r));
    out.emplace_back();
    for (uint32_t k = 0; k < kLooks; ++k) {
      const float u = rng.next_float(), v = rng.next_float();
      const Hit hit = tracer.closest(from.position, leave(from, square_to_cosine_hemisphere(u, v)));
      if (!hit || is_dark_back(tracer.scene(), hit)) continue;
      const Object& object = tracer.scene().objects[hit.object];
      out.back().push_back(shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back));
    }
  }
  return out;
}

/// What a light does there, by receiver, squared: a rough idea of its energy.
double energy(const RayTracer& tracer, const std::vector<std::vector<ShadingPoint>>& seen, const Light& light) {
  double sum = 0;
  for (const auto& of : seen) {
    double of_receiver = 0;
    for (const ShadingPoint& point : of) of_receiver += static_cast<double>(irradiance(tracer, light, point));
    sum += of_receiver * of_receiver;
  }
  return sum;
}

/// ρ/π, the mean of the channels.
float reflectance(const Scene& scene, const Object& object, uint32_t triangle, float b1, float b2) {
  const Vec3 albedo = albedo_at(scene, object, object.triangles[triangle], b1, b2);
  return (albedo.x + albedo.y + albedo.z) / (3 * kPi);
}

}  // namespace

absl::StatusOr<SampleLights> SampleLights::create(const RayTracer& tracer, const Plan& ground, int count,
                                                  const Parallel& how) {
  SampleLights out;
  const size_t lights = static_cast<size_t>(count);
  const absl::Status cancelled = absl::CancelledError("cancelled while choosing parameters");
  Parallel quiet = how;
  quiet.progress = nullptr;
  constexpr size_t kAttempts = 4;
  std::vector<Light> tried(kAttempts * lights);
  std::vector<double> energies(tried.size());
  const auto seen = seen_by(tracer, ground, stratified(front_receivers(ground.receivers), kLookingReceivers, kSeed));
  if (!parallel_for(tried.size(), quiet, [&](uint64_t i) {
        tried[i] = light_at(tracer, ground, i % lights, lights, i / lights);
        energies[i] = energy(tracer, seen, tried[i]);
      })) {
    return cancelled;
  }
  std::vector<double> sorted(energies.begin(), energies.begin() + count);
  std::sort(sorted.begin(), sorted.end());
  for (size_t i = 0; i < lights; ++i) {
    size_t best = i;
    for (size_t k = i + lights; k < tried.size() && energies[best] < kWasted * sorted[lights / 2]; k += lights) {
      if (energies[k] > energies[best]) best = k;
    }
    out.lights_.push_back(tried[best]);
  }

  const Scene& scene = tracer.scene();
  out.radiance_.resize(ground.receivers.all.size() * lights);
  const bool done = parallel_for(ground.receivers.all.size(), quiet, [&](uint64_t i) {
    const Receiver& r = ground.receivers.all[i];
    const Texel& texel = ground.receivers.grids[r.object].texels[r.texel];
    const Object& object = scene.objects[r.object];
    const float reflected = reflectance(scene, object, texel.triangle, texel.b1, texel.b2);
    const std::vector<ShadingPoint> all =
        texel_points(object, ground.layout.uv[r.object], ground.receivers.grids[r.object], texel, r.back, r.parts);
    const size_t points = std::min(all.size(), kPoints);
    for (size_t p = 0; p < points; ++p) {
      // Of sixteen, one of each row and column.
      const ShadingPoint& point = all[(p * all.size() / points + p) % all.size()];
      for (size_t l = 0; l < lights; ++l) {
        out.radiance_[i * lights + l] +=
            reflected / static_cast<float>(points) * irradiance(tracer, out.lights_[l], point);
      }
    }
  });
  if (!done) return cancelled;
  return out;
}

void SampleLights::radiance_at(const RayTracer& tracer, const Hit& hit, std::span<float> out) const {
  const Scene& scene = tracer.scene();
  const Object& object = scene.objects[hit.object];
  const ShadingPoint point = shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back);
  const float reflected = reflectance(scene, object, hit.triangle, hit.b1, hit.b2);
  for (size_t l = 0; l < lights_.size(); ++l) out[l] = reflected * irradiance(tracer, lights_[l], point);
}

}  // namespace lightloom
