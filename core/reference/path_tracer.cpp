// Kajiya, "The Rendering Equation", 1986: path tracing with next-event estimation of punctual lights at every bounce.
// Emission and sky are found by the paths themselves.
#include "core/reference/path_tracer.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <optional>
#include <vector>

#include "core/receivers/receivers.h"
#include "core/receivers/texel_opening.h"
#include "core/scene/picture.h"

namespace lightloom {
namespace {

constexpr int kFirstRouletteDepth = 4;

/// π times the mean radiance over the cosine-weighted hemisphere of points that `point(jitter)` yields.
Vec3 irradiance(const RayTracer& tracer, const std::function<ShadingPoint(Sample2)>& point, int bounces, int samples,
                Rng* rng) {
  const uint32_t side = strata(samples);
  Vec3 sum;
  for (uint32_t i = 0; i < side * side; ++i) {
    const ShadingPoint s = point({rng->next_float(), rng->next_float()});
    const Sample2 uv = stratified(i, side, rng);
    sum += trace_path(tracer, s.position, leave(s, square_to_cosine_hemisphere(uv.u, uv.v)), bounces, rng);
  }
  return sum * (kPi / static_cast<float>(side * side));
}

/// One value per (item, half), then the mean image and the noise from the halves.
struct Halves {
  std::vector<Vec3> first, second;

  explicit Halves(size_t n) : first(n), second(n) {}
  double noise(const std::vector<float>& weight) const {
    double difference = 0, total = 0;
    for (size_t i = 0; i < first.size(); ++i) {
      const Vec3 d = first[i] - second[i], s = first[i] + second[i];
      difference += static_cast<double>(weight[i]) * dot(d, d);
      total += static_cast<double>(weight[i]) * dot(s, s);
    }
    return total > 0 ? std::sqrt(difference / total) : 0;
  }
};

}  // namespace

Vec3 direct_irradiance(const RayTracer& tracer, const ShadingPoint& p) {
  Vec3 sum;
  for (const Light& light : tracer.scene().lights) {
    const Incident in = incident_light(light, p.position);
    const float cosine = dot(p.normal, in.to_light);
    if (!(cosine > 0) || dot(p.geometric, in.to_light) <= 0 || in.irradiance == Vec3{}) continue;
    if (tracer.occluded(p.position, in.to_light, in.distance)) continue;
    sum += in.irradiance * cosine;
  }
  return sum;
}

Vec3 trace_path(const RayTracer& tracer, Vec3 origin, Vec3 direction, int bounces, Rng* rng) {
  const Scene& scene = tracer.scene();
  Vec3 radiance, throughput{1, 1, 1};
  for (int depth = 1;; ++depth) {  // at depth d light has been reflected d − 1 times between here and the receiver
    const Hit hit = tracer.closest(origin, direction);
    if (!hit) return radiance + throughput * scene.environment;
    const Object& object = scene.objects[hit.object];
    const Triangle& triangle = object.triangles[hit.triangle];
    if (is_dark_back(scene, hit)) return radiance;
    if (!hit.back) radiance += throughput * emission_at(scene, object, triangle, hit.b1, hit.b2);
    if (depth > bounces) return radiance;

    const ShadingPoint s = shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back);
    throughput = throughput * albedo_at(scene, object, triangle, hit.b1, hit.b2);
    radiance += throughput * direct_irradiance(tracer, s) * (1 / kPi);

    // Russian roulette by what the path can still carry.
    if (depth >= kFirstRouletteDepth) {
      const float survive = std::min(0.98f, std::max({throughput.x, throughput.y, throughput.z}));
      if (!(rng->next_float() < survive)) return radiance;
      throughput = throughput / survive;
    }
    origin = s.position;
    const float u = rng->next_float(), v = rng->next_float();
    direction = leave(s, square_to_cosine_hemisphere(u, v));
  }
}

absl::StatusOr<ReferenceResult> reference_lightmap(const RayTracer& tracer, const AtlasLayout& layout,
                                                   const ReferenceOptions& options) {
  const Scene& scene = tracer.scene();
  struct Item {
    uint32_t object;
    uint32_t texel;
  };
  std::vector<TexelGrid> grids(scene.objects.size());
  std::vector<Item> items;
  for (uint32_t o = 0; o < scene.objects.size(); ++o) {
    if (layout.uv[o].corners.empty()) continue;
    grids[o] = rasterise(scene.objects[o], layout.uv[o]);
    for (uint32_t t = 0; t < grids[o].texels.size(); ++t) {
      if (grids[o].texels[t].centre_covered) items.push_back({o, t});
    }
  }

  Halves halves(items.size());
  const bool done = parallel_for(items.size(), options.parallel, [&](uint64_t i) {
    const Object& object = scene.objects[items[i].object];
    const TexelGrid& grid = grids[items[i].object];
    const Texel& texel = grid.texels[items[i].texel];
    const LightmapUv& uv = layout.uv[items[i].object];
    const uint64_t texel_seed = receiver_seed(object, texel.y * static_cast<uint32_t>(grid.width) + texel.x);
    const uint64_t key = hash_combine(texel_seed, options.seed);
    std::optional<TexelOpening> opening;  // Cycles knows of none
    if (options.footprint == Footprint::kTexel) {
      opening.emplace(tracer, object, uv, grid, texel, /*back=*/false, texel_seed);
    }
    const auto point = [&](Sample2 jitter) {
      const SurfacePoint s = sample_texel(object, uv, grid, texel, jitter, options.footprint,
                                          [&](const SurfacePoint& p) { return opening->contains(p); });
      return shading_point(object, s.triangle, s.b1, s.b2, false);
    };
    Rng first(hash_combine(key, 1)), second(hash_combine(key, 2));
    halves.first[i] = irradiance(tracer, point, options.bounces, options.samples / 2, &first);
    halves.second[i] = irradiance(tracer, point, options.bounces, options.samples / 2, &second);
  });
  if (!done) return absl::CancelledError("reference cancelled");

  ReferenceResult result;
  result.image = Image(layout.width, layout.height, {"R", "G", "B", "A", "area"});
  std::vector<float> weight(items.size());
  for (size_t i = 0; i < items.size(); ++i) {
    const Texel& texel = grids[items[i].object].texels[items[i].texel];
    const int x = layout.placements[items[i].object].x + static_cast<int>(texel.x);
    const int y = layout.placements[items[i].object].y + static_cast<int>(texel.y);
    result.image.set_rgb(x, y, (halves.first[i] + halves.second[i]) * 0.5f);
    (*result.image.channel("A"))[result.image.index(x, y)] = 1;
    (*result.image.channel("area"))[result.image.index(x, y)] = texel.area;
    weight[i] = texel.area;
  }
  result.noise = halves.noise(weight);
  return result;
}

absl::StatusOr<ReferenceResult> reference_camera(const RayTracer& tracer, const Camera& camera, int width,
                                                 const ReferenceOptions& options) {
  const Scene& scene = tracer.scene();
  LL_ASSIGN_OR_RETURN(const int height, image_height(camera, width));
  const size_t pixels = static_cast<size_t>(width) * static_cast<size_t>(height);
  Halves halves(pixels);
  std::vector<float> valid(pixels, 0);
  const bool done = parallel_for(pixels, options.parallel, [&](uint64_t i) {
    const int x = static_cast<int>(i % static_cast<uint64_t>(width)),
              y = static_cast<int>(i / static_cast<uint64_t>(width));
    const Hit hit = tracer.closest(camera.position,
                                   camera_direction(camera, (static_cast<float>(x) + 0.5f) / static_cast<float>(width),
                                                    (static_cast<float>(y) + 0.5f) / static_cast<float>(height)));
    if (!hit) return;
    valid[i] = 1;
    const ShadingPoint s = shading_point(scene.objects[hit.object], hit.triangle, hit.b1, hit.b2, hit.back);
    const auto point = [&](Sample2) { return s; };
    Rng first(hash_combine(hash_combine(i, options.seed), 1)), second(hash_combine(hash_combine(i, options.seed), 2));
    halves.first[i] = irradiance(tracer, point, options.bounces, options.samples / 2, &first);
    halves.second[i] = irradiance(tracer, point, options.bounces, options.samples / 2, &second);
  });
  if (!done) return absl::CancelledError("reference cancelled");

  ReferenceResult result;
  result.image = Image(width, height, {"R", "G", "B", "A"});
  for (size_t i = 0; i < pixels; ++i) {
    const int x = static_cast<int>(i % static_cast<size_t>(width)),
              y = static_cast<int>(i / static_cast<size_t>(width));
    result.image.set_rgb(x, y, (halves.first[i] + halves.second[i]) * 0.5f);
    (*result.image.channel("A"))[i] = valid[i];
  }
  result.noise = halves.noise(valid);
  return result;
}

Vec3 camera_direction(const Camera& camera, float x, float y) {
  const float half = std::tan(camera.yfov / 2);
  return normalize(camera.forward + camera.right * ((2 * x - 1) * half * camera.aspect) +
                   camera.up * ((1 - 2 * y) * half));
}

}  // namespace lightloom
