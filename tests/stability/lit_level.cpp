#include "tests/stability/lit_level.h"

#include <algorithm>
#include <cmath>

#include "cli/player.h"
#include "core/base/sampling.h"
#include "core/receivers/texel_opening.h"
#include "core/scene/picture.h"
#include "core/scene/srgb.h"

namespace lightloom::stability {
namespace {

constexpr int kPictureWidth = 160;
constexpr float kPictureAspect = 4.0f / 3;

Camera camera_of(const Scene& scene, const View& view) {
  Camera camera;
  camera.aspect = kPictureAspect;
  Vec3 to = view.to;
  if (view.inside) {
    camera.position = view.from;
    camera.yfov = 1.3f;
  } else {
    const Aabb box = scene.bounds();
    camera.yfov = 0.5f;
    to = box.center();
    camera.position = to + normalize(view.direction) * (0.42f * length(box.size()) / std::sin(0.25f));
  }
  camera.forward = normalize(to - camera.position);
  camera.right = normalize(cross(camera.forward, {0, 1, 0}));
  camera.up = cross(camera.right, camera.forward);
  return camera;
}

/// The nearest surface that is seen from its front, or has two.
Hit first_front(const RayTracer& tracer, Vec3 origin, Vec3 direction) {
  const Scene& scene = tracer.scene();
  for (int passed = 0; passed < 32; ++passed) {
    const Hit hit = tracer.closest(origin, direction);
    if (!hit || !hit.back) return hit;
    if (scene.materials[scene.objects[hit.object].triangles[hit.triangle].material].double_sided) return hit;
    const Vec3 p = tracer.position(hit);
    origin = p + direction * RayTracer::offset(p);
  }
  return {};
}

/// A small part of a surface that a lamp lights.
struct Patch {
  ShadingPoint at;
  Vec3 intensity;  ///< W/sr along its normal: albedo ÷ π of the flux that arrives
};

/// Where a ray of a lamp, which carries `flux`, ends, if that reflects.
void add_patch(const RayTracer& tracer, Vec3 origin, Vec3 direction, const std::function<Vec3(Vec3)>& flux,
               std::vector<Patch>* out) {
  const Scene& scene = tracer.scene();
  const Hit hit = tracer.closest(origin, direction);
  if (!hit) return;
  const Object& object = scene.objects[hit.object];
  const Triangle& t = object.triangles[hit.triangle];
  if (hit.back && !scene.materials[t.material].double_sided) return;
  const ShadingPoint at = shading_point(object, hit.triangle, hit.b1, hit.b2, hit.back);
  out->push_back({at, albedo_at(scene, object, t, hit.b1, hit.b2) * flux(at.position) * (1 / kPi)});
}

std::vector<Patch> lit_patches(const RayTracer& tracer, uint32_t rays) {
  std::vector<Patch> out;
  for (const Light& light : tracer.scene().lights) {
    const auto intensity = [&](Vec3 p) {
      const Incident in = incident_light(light, p);
      return in.irradiance * (in.distance * in.distance);
    };
    const float n = static_cast<float>(rays);
    for (uint32_t i = 0; i < rays; ++i) {
      const Vec3 d = sphere_direction(i, rays);
      if (light.type == LightType::kPoint) {
        add_patch(
            tracer, light.position, d, [&](Vec3 p) { return intensity(p) * (4 * kPi / n); }, &out);
      } else if (light.type == LightType::kSpot) {
        // The same points, squeezed into the cap of the cone, whose area they cover as evenly.
        const float height = 1 - std::cos(light.outer_cone_angle), c = 1 - height * (1 - d.z) / 2;
        const float s = std::sqrt(std::max(0.0f, 1 - c * c) / std::max(1e-12f, 1 - d.z * d.z));
        add_patch(
            tracer, light.position, to_world({d.x * s, d.y * s, c}, light.direction),
            [&](Vec3 p) { return intensity(p) * (2 * kPi * height / n); }, &out);
      } else {
        // From a disc around the level, by the same points: z is uniform, and so is the area that it encloses.
        const Aabb box = tracer.scene().bounds();
        const float radius = 0.5f * length(box.size()), share = (1 - d.z) / 2;
        const float s = radius * std::sqrt(share / std::max(1e-12f, 1 - d.z * d.z));
        const Vec3 from =
            box.center() - light.direction * (2 * radius) + to_world({d.x * s, d.y * s, 0}, light.direction);
        add_patch(
            tracer, from, light.direction,
            [&](Vec3 p) { return incident_light(light, p).irradiance * (kPi * radius * radius / n); }, &out);
      }
    }
  }
  return out;
}

float displayed(float linear) { return to_srgb(std::clamp(linear, 0.0f, 1.0f)); }

}  // namespace

std::unique_ptr<BakedLevel> bake_at(Scene scene, float spacing, float texels_per_metre) {
  BakeParams params;
  params.spacing = spacing;
  params.texels_per_metre = texels_per_metre;
  return bake_level(std::move(scene), params);
}

Field relight(const BakedLevel& level, int bounces, int samples, Device device) {
  return light(level, bounces, device, samples);
}

Truth trace_truth(const BakedLevel& level, int bounces, int samples, uint64_t seed) {
  ReferenceOptions options;
  options.bounces = bounces;
  options.samples = samples;
  options.seed = seed;
  ReferenceResult result = value_or_die(reference_lightmap(*level.tracer, level.elements.layout, options));
  return {std::move(result.image), result.noise};
}

Truth trace_from_lamps(const BakedLevel& level, uint32_t rays) {
  constexpr uint32_t kSide = 4, kPoints = kSide * kSide;  // of a texel
  const Scene& scene = *level.scene;
  const std::vector<Patch> patches = lit_patches(*level.tracer, rays);
  Field e(level.elements.receivers.all.size());
  parallel_for(e.size(), {}, [&](uint64_t i) {
    const Receiver& r = level.elements.receivers.all[i];
    const Object& object = scene.objects[r.object];
    const TexelGrid& grid = level.elements.receivers.grids[r.object];
    const Texel& texel = grid.texels[r.texel];
    const LightmapUv& uv = level.elements.layout.uv[r.object];
    const TexelOpening opening(*level.tracer, object, uv, grid, texel, r.back, r.seed);
    const auto open = [&](const SurfacePoint& p) { return opening.contains(p); };
    Rng rng(hash_combine(r.seed, 0x1a3b5));
    for (uint32_t k = 0; k < kPoints; ++k) {
      const SurfacePoint s = sample_texel(object, uv, grid, texel, stratified(k, kSide, &rng), Footprint::kTexel, open);
      const ShadingPoint x = shading_point(object, s.triangle, s.b1, s.b2, r.back);
      for (size_t p = k; p < patches.size(); p += kPoints) {
        const Vec3 d = patches[p].at.position - x.position;
        const float distance2 = dot(d, d), at_x = dot(x.normal, d), at_patch = -dot(patches[p].at.normal, d);
        if (!(at_x > 0) || !(at_patch > 0) || !level.tracer->visible(x.position, patches[p].at.position)) continue;
        e[i] += patches[p].intensity * (at_x * at_patch / (distance2 * distance2));
      }
    }
  });
  return {lightmap_image(level.elements, e), 0};
}

Field truth_field(const BakedLevel& level, const Truth& truth, const Field& instead) {
  Field out = instead;
  const auto& valid = *truth.image.channel("A");
  for (size_t i = 0; i < out.size(); ++i) {
    const Receiver& r = level.elements.receivers.all[i];
    const Texel& texel = level.elements.receivers.grids[r.object].texels[r.texel];
    const Placement at = level.elements.layout.placements[r.object];
    const int x = at.x + static_cast<int>(texel.x), y = at.y + static_cast<int>(texel.y);
    if (!r.back && valid[truth.image.index(x, y)] > 0.5f) out[i] = truth.image.rgb(x, y);
  }
  return out;
}

double area(const BakedLevel& level, size_t element) {
  const Receiver& r = level.elements.receivers.all[element];
  return static_cast<double>(level.elements.receivers.grids[r.object].texels[r.texel].area);
}

double mean(const BakedLevel& level, const Field& e, const Keep& keep) {
  double sum = 0, weight = 0;
  for (size_t i = 0; i < e.size(); ++i) {
    if (keep && !keep(level.elements.receivers.all[i])) continue;
    sum += area(level, i) * static_cast<double>(e[i].x + e[i].y + e[i].z) / 3;
    weight += area(level, i);
  }
  return sum / weight;
}

Comparison error(const BakedLevel& level, const Field& e, const Truth& truth, const Keep& keep) {
  Image image = lightmap_image(level.elements, e);
  std::vector<float>& valid = *image.channel("A");
  for (const Receiver& r : level.elements.receivers.all) {
    if (r.back || !keep || keep(r)) continue;
    const Texel& texel = level.elements.receivers.grids[r.object].texels[r.texel];
    const Placement at = level.elements.layout.placements[r.object];
    valid[image.index(at.x + static_cast<int>(texel.x), at.y + static_cast<int>(texel.y))] = 0;
  }
  return value_or_die(compare(image, truth.image, {}));
}

double difference(const BakedLevel& level, const Field& a, const Field& b) {
  double error2 = 0, norm2 = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const Vec3 d = a[i] - b[i];
    error2 += area(level, i) * static_cast<double>(dot(d, d));
    norm2 += area(level, i) * static_cast<double>(dot(b[i], b[i]));
  }
  return std::sqrt(error2 / norm2);
}

Image picture(const BakedLevel& level, const Field& e, const View& view, float* exposure) {
  constexpr uint32_t kSide = 2;  // points per pixel, squared
  const Camera camera = camera_of(*level.scene, view);
  Image out(kPictureWidth, value_or_die(image_height(camera, kPictureWidth)), {"R", "G", "B"});
  const ReceiverSearch search(*level.tracer, level.elements.layout, level.elements.receivers);
  parallel_for(static_cast<uint64_t>(out.height), {}, [&](uint64_t row) {
    for (int x = 0; x < out.width; ++x) {
      Vec3 sum;
      for (uint32_t s = 0; s < kSide * kSide; ++s) {
        const float u = (static_cast<float>(x) + (0.5f + static_cast<float>(s % kSide)) / kSide) /
                        static_cast<float>(out.width),
                    v = (static_cast<float>(row) + (0.5f + static_cast<float>(s / kSide)) / kSide) /
                        static_cast<float>(out.height);
        const Hit hit = first_front(*level.tracer, camera.position, camera_direction(camera, u, v));
        if (hit) sum += sample_irradiance(level.elements, search, e, hit) / kPi;
      }
      out.set_rgb(x, static_cast<int>(row), sum / (kSide * kSide));
    }
  });
  *exposure = expose(&out, *exposure);
  return out;
}

Image beside(const BakedLevel& level, const Field& a, const Field& b, const View& view) {
  constexpr float kGain = 8;
  float exposure = 0;
  const Image right = picture(level, b, view, &exposure), left = picture(level, a, view, &exposure);
  const int w = left.width;
  Image out(3 * w, left.height, {"R", "G", "B"});
  for (int y = 0; y < left.height; ++y) {
    for (int x = 0; x < w; ++x) {
      const Vec3 p = left.rgb(x, y), q = right.rgb(x, y);
      Vec3 d;
      for (int c = 0; c < 3; ++c) {
        d[c] = static_cast<float>(from_srgb(std::min(1.0f, kGain * std::abs(displayed(p[c]) - displayed(q[c])))));
      }
      out.set_rgb(x, y, p);
      out.set_rgb(w + x, y, q);
      out.set_rgb(2 * w + x, y, d);
    }
  }
  return out;
}

}  // namespace lightloom::stability
