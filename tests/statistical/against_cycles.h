// The reference against lightmaps baked by Blender Cycles 3.4, from the folder of the big test scenes.
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "core/reference/compare.h"
#include "core/reference/path_tracer.h"
#include "core/scene/gltf.h"
#include "tests/support/test_scenes.h"

namespace lightloom::test {

struct CyclesCase {
  const char* scene;
  int bounces;
  int lightmap_size;  ///< texels, of the baked image
  int samples;
  double bound;  ///< on rel_rmse over blocks of 4 × 4 texels
};

/// Cycles 3.4 interpolates 8-bit textures before it decodes sRGB; glTF asks for the reverse, which is
/// brighter. Textures drawn out by Cycles' rule leave next to nothing to interpolate by ours.
inline void draw_out_textures(Scene* scene) {
  constexpr int kFactor = 4;
  for (Texture& texture : scene->textures) {
    if (!texture.srgb) continue;
    Texture encoded = texture;
    encoded.srgb = false;
    texture.width *= kFactor;
    texture.height *= kFactor;
    texture.rgba.clear();
    for (int y = 0; y < texture.height; ++y) {
      for (int x = 0; x < texture.width; ++x) {
        const Vec2 uv{(static_cast<float>(x) + 0.5f) / static_cast<float>(texture.width),
                      (static_cast<float>(y) + 0.5f) / static_cast<float>(texture.height)};
        const Vec3 c = encoded.sample(uv);
        for (const float v : {c.x, c.y, c.z, encoded.sample_alpha(uv)}) {
          texture.rgba.push_back(static_cast<uint8_t>(std::lround(255 * v)));
        }
      }
    }
  }
}

inline void PrintTo(const CyclesCase& c, std::ostream* out) { *out << c.scene << c.bounces; }

inline std::string case_name(const testing::TestParamInfo<CyclesCase>& info) {
  return std::string(info.param.scene) + "_" + std::to_string(info.param.bounces) + "bounce";
}

/// Traces the case and checks it: rel_rmse within the bound, the ratio of sums within three standard errors
/// of 1.
inline void check_against_cycles(const CyclesCase& c) {
  const std::filesystem::path folder = scenes_folder() / c.scene;
  const auto file = folder / "references" / ("indirect_" + std::to_string(c.bounces) + "bounce.exr");
  if (!std::filesystem::exists(folder / "scene.glb") || !std::filesystem::exists(file)) {
    GTEST_SKIP() << "no " << c.scene << "/scene.glb with references/" << file.filename().string()
                 << ": set LIGHTLOOM_SCENES to the folder of the test scenes";
  }
  auto scene = load_gltf(folder / "scene.glb");
  ASSERT_TRUE(scene.ok()) << scene.status();
  draw_out_textures(&*scene);
  const auto truth = read_exr(file);
  ASSERT_TRUE(truth.ok()) << truth.status();
  const auto tracer = RayTracer::create(*scene);
  ASSERT_TRUE(tracer.ok()) << tracer.status();
  LayoutOptions layout_options;
  layout_options.lightmap_size = c.lightmap_size;
  const auto layout = make_layout(*scene, layout_options);
  ASSERT_TRUE(layout.ok()) << layout.status();

  ReferenceOptions options;
  options.bounces = c.bounces;
  options.samples = c.samples;
  options.footprint = Footprint::kCycles;
  const auto reference = reference_lightmap(**tracer, *layout, options);
  ASSERT_TRUE(reference.ok()) << reference.status();
  CompareOptions compare_options;
  compare_options.block = 4;
  compare_options.scale_b = kPi;
  const auto comparison = compare(reference->image, *truth, compare_options);
  ASSERT_TRUE(comparison.ok()) << comparison.status();

  std::printf(
      "%s, %d bounces, %d samples: rel_rmse %.5f (own noise per texel %.5f), ratio %.5f, ratio_error %.5f, "
      "%llu texels\n",
      c.scene, c.bounces, c.samples, comparison->rel_rmse, reference->noise, comparison->ratio, comparison->ratio_error,
      static_cast<unsigned long long>(comparison->texels));
  EXPECT_LE(comparison->rel_rmse, c.bound);
  EXPECT_GT(comparison->ratio_error, 0);
  EXPECT_LE(std::abs(comparison->ratio - 1), 3 * comparison->ratio_error)
      << "ratio " << comparison->ratio << ", its standard error " << comparison->ratio_error;
  // Nearly all texels that Cycles baked are compared.
  uint64_t baked = 0;
  for (const float a : *truth->channel("A")) baked += a > 0.5f;
  EXPECT_GT(comparison->texels, baked * 99 / 100);
}

}  // namespace lightloom::test
