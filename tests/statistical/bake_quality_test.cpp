// Baked light against what it must be: closed forms, path tracing, and the same asset on Vulkan.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "core/base/sampling.h"
#include "core/receivers/open_space.h"
#include "core/reference/compare.h"
#include "core/reference/path_tracer.h"
#include "core/relight/lightmap.h"
#include "core/scene/builtin.h"
#include "tests/support/baked_level.h"
#include "tests/support/test_scenes.h"

namespace lightloom {
namespace {

using test::bake_level;
using test::BakedLevel;
using test::Device;
using test::light;
using test::value_or_die;

/// Area-weighted mean over receivers, channels together.
double mean(const BakedLevel& level, const std::vector<Vec3>& e, auto&& keep) {
  double sum = 0, weight = 0;
  for (size_t i = 0; i < e.size(); ++i) {
    const Receiver& r = level.elements.receivers.all[i];
    if (!keep(r)) continue;
    const double area = level.elements.receivers.grids[r.object].texels[r.texel].area;
    sum += area * (e[i].x + e[i].y + e[i].z) / 3;
    weight += area;
  }
  return sum / weight;
}

TEST(OpenPlane, WhiteSkyGivesPi) {
  BakeParams params;
  params.spacing = 1;
  params.texels_per_metre = 4;
  const auto level = bake_level(test::open_plane(4, {1, 1, 1}), params);
  for (const Vec3 e : light(*level, 1)) ASSERT_NEAR(e.x, kPi, 0.01f * kPi);
}

/// Eight seeded point lights in the box's free space: at least half a metre from any surface.
std::vector<Light> random_lights(const RayTracer& tracer) {
  std::vector<Light> lights;
  Rng rng(2017);
  const Aabb box = tracer.scene().bounds();
  while (lights.size() < 8) {
    const Vec3 u{rng.next_float(), rng.next_float(), rng.next_float()};
    const Vec3 p = box.lo + u * box.size();
    FirstHits f;
    for (uint32_t i = 0; i < 256; ++i) f.add(tracer.closest(p, sphere_direction(i, 256)));
    if (f.solid() || f.nearest < 0.5f) continue;
    Light light;
    light.position = p;
    light.intensity = 20;
    lights.push_back(light);
  }
  return lights;
}

std::unique_ptr<BakedLevel> bake_cornell(BakeParams params, float spacing) {
  params.spacing = spacing;
  params.texels_per_metre = 6;
  return bake_level(value_or_die(builtin_scene("cornell")), params);
}

ReferenceResult truth_of(const BakedLevel& level, const Light& light) {
  level.scene->lights = {light};
  ReferenceOptions options;
  options.samples = 1600;
  return value_or_die(reference_lightmap(*level.tracer, level.elements.layout, options));
}

/// rel_rmse of one bounce of the light.
double error_of(const BakedLevel& level, const Light& one, const ReferenceResult& truth) {
  level.scene->lights = {one};
  return value_or_die(compare(lightmap_image(level.elements, light(level, 1)), truth.image, {})).rel_rmse;
}

// The bounds are those of an early prototype, with its probes, order and lights.
TEST(Cornell, EightRandomLights) {
  BakeParams ours, sl17 = sl17_params();
  sl17.probes = 26;
  sl17.relight_rays = ours.relight_rays;
  const auto level = bake_cornell(ours, 2.3f), baseline = bake_cornell(sl17, 2.3f);
  ASSERT_EQ(level->manifest.probes.size(), 26u);
  ASSERT_EQ(baseline->manifest.probes.size(), 26u);
  double log_ours = 0, log_sl17 = 0;
  for (const Light& one : random_lights(*level->tracer)) {
    const ReferenceResult truth = truth_of(*level, one);
    const double of_ours = error_of(*level, one, truth), of_sl17 = error_of(*baseline, one, truth);
    std::printf("light at %.2f %.2f %.2f: rel_rmse %.4f, SL17 %.4f (reference noise %.4f)\n",
                static_cast<double>(one.position.x), static_cast<double>(one.position.y),
                static_cast<double>(one.position.z), of_ours, of_sl17, truth.noise);
    EXPECT_LE(of_ours, 1.1 * of_sl17);
    log_ours += std::log(of_ours);
    log_sl17 += std::log(of_sl17);
  }
  std::printf("26 probes, order 7: geometric mean rel_rmse %.4f, SL17 %.4f\n", std::exp(log_ours / 8),
              std::exp(log_sl17 / 8));
  EXPECT_LE(std::exp(log_ours / 8), 0.105);
  EXPECT_LE(std::exp(log_sl17 / 8), 0.12);
}

// SL17 Figs. 10 and 11: more probes err less; higher orders err less, by less each time.
TEST(Cornell, Sl17FollowsItsPublishedTrends) {
  std::vector<Light> lights;
  std::vector<ReferenceResult> truths;
  const auto error = [&](int probes, int order) {
    BakeParams params = sl17_params();
    params.probes = probes;
    params.order = order;
    const auto level = bake_cornell(params, 2.3f);
    if (lights.empty()) {
      lights = random_lights(*level->tracer);
      lights.resize(4);
      for (const Light& one : lights) truths.push_back(truth_of(*level, one));
    }
    double log_error = 0;
    for (size_t i = 0; i < lights.size(); ++i) log_error += std::log(error_of(*level, lights[i], truths[i]));
    const double mean = std::exp(log_error / static_cast<double>(lights.size()));
    std::printf("%d probes, order %d: geometric mean rel_rmse %.4f\n", probes, order, mean);
    return mean;
  };
  const double of_26 = error(26, 7);
  const double by_probes[] = {error(2, 7), error(8, 7), of_26, error(100, 7)};
  for (size_t i = 1; i < 4; ++i) EXPECT_LT(by_probes[i], by_probes[i - 1]);
  const double by_order[] = {error(26, 1), error(26, 3), error(26, 5), of_26};
  for (size_t i = 1; i < 4; ++i) EXPECT_LT(by_order[i], by_order[i - 1]);
  EXPECT_LT(by_order[2] - by_order[3], 0.5 * (by_order[0] - by_order[1]));
}

TEST(Vulkan, SameLightAsTheDecoder) {
  BakeParams params;
  params.texels_per_metre = 6;
  const auto level = bake_level(value_or_die(builtin_scene("flat")), params);
  const std::vector<Vec3> cpu = light(*level, 4), gpu = light(*level, 4, Device::kVulkan);
  const double scale = mean(*level, cpu, [](const Receiver&) { return true; });
  std::vector<double> error;
  for (size_t i = 0; i < cpu.size(); ++i) {
    const Vec3 d = cpu[i] - gpu[i];
    error.push_back(std::max({std::abs(d.x), std::abs(d.y), std::abs(d.z)}) / scale);
  }
  const auto p999 = error.begin() + static_cast<std::ptrdiff_t>(static_cast<double>(error.size()) * 0.999);
  std::nth_element(error.begin(), p999, error.end());
  std::printf("99.9th percentile of |E_vulkan - E_cpu| / mean E: %.2e\n", *p999);
  EXPECT_LE(*p999, 0.005);
}

}  // namespace
}  // namespace lightloom
