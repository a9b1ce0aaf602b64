// Cells of few columns and probes of few rays; one detail that takes another's place; and how E gets there.
#include "runtime/detail.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include <set>

#include "core/base/rng.h"
#include "core/base/sh.h"
#include "runtime/decoder.h"
#include "tests/unit/runtime/test_runtime.h"

namespace lightloom {
namespace {

using testing::joined;
using testing::p999_error;
using testing::SyntheticAsset;
using testing::TestRuntime;

constexpr uint32_t kAll = UINT32_MAX;

TEST(CoarseRays, OneOfEachBand) {
  for (const uint32_t rays : {512u, 1000u, 4096u, 8000u}) {
    const std::vector<uint32_t> coarse = coarse_rays(rays);
    ASSERT_EQ(coarse.size(), 256u);
    for (uint32_t m = 0; m < 256; ++m) {
      EXPECT_GE(coarse[m], rays * m / 256);
      EXPECT_LT(coarse[m], rays * (m + 1) / 256);
    }
  }
  EXPECT_EQ(coarse_rays(300), every_ray(300));
}

/// The mean of a harmonic over the sphere is 0. Over 256 independent directions it would be 1/√256 = 0.0625 in the root
/// mean square (E[Y²] = 1/4π, here times √4π).
TEST(CoarseRays, IntegrateLowBandsBetterThanRandomOnes) {
  const int order = 4;
  const std::vector<uint32_t> coarse = coarse_rays(4096);
  std::vector<double> mean(static_cast<size_t>(sh_count(order)));
  std::vector<float> y(mean.size());
  for (const uint32_t r : coarse) {
    sh_evaluate(order, sphere_direction(r, 4096), y);
    for (size_t j = 0; j < y.size(); ++j) mean[j] += std::sqrt(4 * 3.14159265358979) * static_cast<double>(y[j]) / 256;
  }
  EXPECT_NEAR(mean[0], 1, 1e-6);
  for (size_t j = 1; j < mean.size(); ++j) EXPECT_LT(std::abs(mean[j]), 0.0625 / 2) << "harmonic " << j;
}

class DetailTest : public ::testing::TestWithParam<uint32_t> {
 protected:
  DetailTest() {
    testing::RandomAssetOptions o;
    o.order = 3;
    o.relight_rays = 1024;
    o.objects = 8;
    o.side = 20;
    o.probes = 70;
    o.cells = 12;
    asset_ = testing::random_asset(o);
    source_.emplace(*asset_.open());
    light_ = testing::random_light(source_->surface_elements(), 5);
  }
  std::unique_ptr<TestRuntime> lit_runtime() {
    auto runtime = std::make_unique<TestRuntime>(GetParam() | LIGHTLOOM_CREATE_SMOOTHING);
    EXPECT_EQ(runtime->load(asset_), LIGHTLOOM_OK) << joined(runtime->received().errors);
    runtime->light(light_);
    return runtime;
  }
  void load_cells(TestRuntime& runtime, uint32_t max_rank, uint32_t bands = 0) const {
    for (const CellEntry& c : asset_.manifest.cells) {
      ASSERT_EQ(runtime.load_part(asset_, c.chunk.digest, max_rank, false, false, bands), LIGHTLOOM_OK);
    }
  }
  void load_probes(TestRuntime& runtime, bool coarse) const {
    for (const ProbeEntry& p : asset_.manifest.probes) {
      ASSERT_EQ(runtime.load_part(asset_, p.relight.digest, 0, coarse), LIGHTLOOM_OK);
    }
  }
  /// Eight bounces of cells that are cut.
  std::vector<Vec3> decoded(uint32_t max_rank, uint32_t bands) const {
    DecoderAsset decoder = *load_decoder_asset(*source_);
    for (SourceCell& c : decoder.cells) limit(&c, {max_rank, bands});
    std::vector<Vec3> e(decoder.surface_elements);
    for (int bounce = 0; bounce < 8; ++bounce) e = decode_frame(decoder, light_, e).irradiance;
    return e;
  }

  SyntheticAsset asset_;
  std::optional<AssetSource> source_;
  SurfaceLight light_;
};

TEST_P(DetailTest, FewColumnsAndBandsAreThoseOfTheDecoder) {
  const auto runtime = lit_runtime();
  const uint64_t all_bytes = runtime->counts().gpu_bytes;
  struct {
    uint32_t max_rank, bands;
  } details[] = {{0, kAll}, {1, kAll}, {5, kAll}, {kAll, 1}, {7, 2}, {3, 3}, {kAll, 3}, {kAll, kAll}};
  for (const auto& d : details) {
    load_cells(*runtime, d.max_rank, d.bands);
    ASSERT_EQ(lightloom_reset_feedback(runtime->get()), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_update(runtime->get(), 8), LIGHTLOOM_OK);
    EXPECT_LT(p999_error(runtime->irradiance(), decoded(d.max_rank, d.bands)), 1e-4) << d.max_rank << ' ' << d.bands;
  }
  // Device memory comes in pages.
  if (GetParam() == LIGHTLOOM_CREATE_CPU) {
    EXPECT_EQ(runtime->counts().gpu_bytes, all_bytes);
    load_cells(*runtime, 1);
    EXPECT_LT(runtime->counts().gpu_bytes, all_bytes);
  }
}

TEST_P(DetailTest, ABaseKeepsTheEnergyOfNearFields) {
  for (uint32_t c = 0; c < asset_.manifest.cells.size(); ++c) {
    const SourceCell whole = *source_->cell(c);
    SourceCell base = whole;
    limit(&base, {4, 4, true, true});
    size_t from = 0, at = 0;
    for (size_t r = 0; r < whole.chunk.near_counts.size(); ++r) {
      const uint16_t count = whole.chunk.near_counts[r];
      ASSERT_EQ(base.chunk.near_counts[r], count > 0);
      if (count == 0) continue;
      const auto first = whole.chunk.near_weights.begin() + static_cast<ptrdiff_t>(from);
      EXPECT_EQ(base.chunk.near_weights[at], std::accumulate(first, first + count, 0));
      const auto greatest = static_cast<size_t>(std::max_element(first, first + count) - first) + from;
      EXPECT_EQ(base.near_elements[at], whole.near_elements[greatest]);
      EXPECT_EQ(base.chunk.near_texels[at], whole.chunk.near_texels[greatest]);
      from += count;
      ++at;
    }
    EXPECT_EQ(base.near_elements.size(), at);
  }
}

TEST_P(DetailTest, FewRaysGiveNearlyTheSameLight) {
  const auto runtime = lit_runtime();
  load_cells(*runtime, 0);
  runtime->settle();
  const std::vector<Vec3> all = runtime->irradiance();
  load_probes(*runtime, true);
  runtime->settle();
  const std::vector<Vec3> few = runtime->irradiance();
  EXPECT_NE(all, few);
  // Rays of this asset end anywhere: 256 of 1024 random samples. In a level neighbours agree.
  double difference = 0, sum = 0;
  for (size_t s = 0; s < all.size(); ++s) {
    difference += std::abs(static_cast<double>(all[s].x) - static_cast<double>(few[s].x));
    sum += static_cast<double>(all[s].x);
  }
  EXPECT_LT(difference / sum, 0.05);
  ASSERT_EQ(lightloom_set_direct(runtime->get(), &light_.emission[0].x, 0, light_.emission.size()), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime->get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(runtime->stats().relight_bytes, runtime->stats().updated_probes * 256u * 4);
  ASSERT_EQ(lightloom_set_direct(runtime->get(), &light_.direct[0].x, 0, light_.direct.size()), LIGHTLOOM_OK);
  // And back.
  load_probes(*runtime, false);
  runtime->settle();
  EXPECT_LT(p999_error(runtime->irradiance(), all), 1e-5);
}

TEST_P(DetailTest, AnyOrderOfDetailsEndsAtTheSameLight) {
  const auto runtime = lit_runtime();
  runtime->settle();
  const std::vector<Vec3> whole = runtime->irradiance();
  runtime->options(0, 0, 0, 1, 0.5f);
  Rng rng(1);
  const auto& cells = asset_.manifest.cells;
  const auto& probes = asset_.manifest.probes;
  for (int step = 0; step < 600; ++step) {
    const Digest& cell = cells[rng.next_below(static_cast<uint32_t>(cells.size()))].chunk.digest;
    const Digest& probe = probes[rng.next_below(static_cast<uint32_t>(probes.size()))].relight.digest;
    switch (rng.next_below(6)) {
      case 0:
        ASSERT_EQ(lightloom_unload_chunk(runtime->get(), (rng.next_below(2) == 0 ? cell : probe).bytes.data()),
                  LIGHTLOOM_OK);
        break;
      case 1:
      case 2: {
        const uint32_t rank = rng.next_below(4) == 0 ? kAll : rng.next_below(6);
        const lightloom_result result = runtime->load_part(asset_, cell, rank);
        ASSERT_TRUE(result == LIGHTLOOM_OK || result == LIGHTLOOM_ERROR_NOT_READY)
            << joined(runtime->received().errors);
        break;
      }
      case 3: {
        const lightloom_result result = runtime->load_part(asset_, probe, 0, rng.next_below(2) == 0);
        ASSERT_TRUE(result == LIGHTLOOM_OK || result == LIGHTLOOM_ERROR_NOT_READY)
            << joined(runtime->received().errors);
        break;
      }
      case 4: {
        const bool is_cell = rng.next_below(2) == 0;
        if (rng.next_below(2) == 0) {
          ASSERT_EQ(lightloom_drop_detail(runtime->get(), (is_cell ? cell : probe).bytes.data()), LIGHTLOOM_OK);
          break;
        }
        const lightloom_result result = runtime->load_part(asset_, is_cell ? cell : probe, 1, true, true);
        ASSERT_TRUE(result == LIGHTLOOM_OK || result == LIGHTLOOM_ERROR_NOT_READY ||
                    result == LIGHTLOOM_ERROR_INVALID_ARGUMENT);
        break;
      }
      default:
        ASSERT_EQ(lightloom_update(runtime->get(), 1), LIGHTLOOM_OK);
    }
  }
  // Memory of what was replaced is free again after some frames.
  ASSERT_EQ(lightloom_update(runtime->get(), 8), LIGHTLOOM_OK);
  for (const ProbeEntry& p : probes) ASSERT_EQ(runtime->load_part(asset_, p.relight.digest, 0), LIGHTLOOM_OK);
  load_cells(*runtime, kAll);
  runtime->settle();
  EXPECT_EQ(runtime->counts().active_cells, cells.size());
  EXPECT_LT(p999_error(runtime->irradiance(), whole), 1e-4);
}

TEST_P(DetailTest, ABaseIsThereAgainOnceTheRestIsDropped) {
  const auto runtime = lit_runtime();
  for (const CellEntry& c : asset_.manifest.cells) {
    ASSERT_EQ(runtime->load_part(asset_, c.chunk.digest, 1, false, true), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
    ASSERT_EQ(lightloom_unload_chunk(runtime->get(), c.chunk.digest.bytes.data()), LIGHTLOOM_OK);
    ASSERT_EQ(runtime->load_part(asset_, c.chunk.digest, 1, false, true), LIGHTLOOM_OK);
  }
  for (const ProbeEntry& p : asset_.manifest.probes) {
    ASSERT_EQ(lightloom_unload_chunk(runtime->get(), p.relight.digest.bytes.data()), LIGHTLOOM_OK);
    ASSERT_EQ(runtime->load_part(asset_, p.relight.digest, 0, true, true), LIGHTLOOM_OK);
  }
  runtime->settle();
  const std::vector<Vec3> base = runtime->irradiance();
  const uint64_t bytes = runtime->counts().gpu_bytes;
  for (int times = 0; times < 3; ++times) {
    load_cells(*runtime, kAll);
    load_probes(*runtime, false);
    runtime->settle();
    EXPECT_NE(runtime->irradiance(), base);
    for (const CellEntry& c : asset_.manifest.cells) {
      ASSERT_EQ(lightloom_drop_detail(runtime->get(), c.chunk.digest.bytes.data()), LIGHTLOOM_OK);
    }
    for (const ProbeEntry& p : asset_.manifest.probes) {
      ASSERT_EQ(lightloom_drop_detail(runtime->get(), p.relight.digest.bytes.data()), LIGHTLOOM_OK);
    }
    EXPECT_EQ(runtime->counts().pending_bytes, 0u);
    runtime->settle();
    EXPECT_LT(p999_error(runtime->irradiance(), base), 1e-5);
  }
  if (GetParam() == LIGHTLOOM_CREATE_CPU) {
    EXPECT_EQ(runtime->counts().gpu_bytes, bytes);
  }
}

TEST_P(DetailTest, AnotherModelFadesInAndLightDoesNot) {
  for (Vec3& a : light_.albedo) a = {};  // no second bounce
  const auto faded = lit_runtime(), plain = lit_runtime();
  faded->options(0, 0, 0, 1, 0.25f);
  faded->settle();
  plain->settle();
  const std::vector<Vec3> before = faded->irradiance();
  EXPECT_EQ(before, plain->irradiance());

  load_cells(*faded, 1);
  load_cells(*plain, 1);
  ASSERT_EQ(lightloom_update(plain->get(), 1), LIGHTLOOM_OK);
  const std::vector<Vec3> after = plain->irradiance();
  const auto far = [](const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
    double sum = 0;
    for (size_t s = 0; s < a.size(); ++s) sum += static_cast<double>(length(a[s] - b[s]));
    return sum;
  };
  const double jump = far(before, after);
  ASSERT_GT(jump, 0);
  double left = jump;
  for (int frame = 0; frame < 4; ++frame) {
    ASSERT_EQ(lightloom_update(faded->get(), 1), LIGHTLOOM_OK);
    EXPECT_NEAR(far(faded->irradiance(), after) / left, 0.75, 1e-3) << frame;
    left = far(faded->irradiance(), after);
  }

  // Light that changes meanwhile is there at once: what is left of the fade stays as it was.
  for (Vec3& d : light_.emission) d = d * 3.0f;
  faded->light(light_);
  plain->light(light_);
  ASSERT_EQ(lightloom_update(plain->get(), 1), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(faded->get(), 1), LIGHTLOOM_OK);
  const double light_jump = far(plain->irradiance(), after);
  EXPECT_GT(light_jump, 4 * jump);
  EXPECT_LE(far(faded->irradiance(), plain->irradiance()), 0.75 * left * 1.001);

  faded->settle();
  EXPECT_LT(p999_error(faded->irradiance(), plain->irradiance()), 1e-6);
}

TEST_P(DetailTest, TheFirstModelOfACellIsThereAtOnce) {
  for (Vec3& a : light_.albedo) a = {};
  const auto plain = lit_runtime();
  plain->settle();
  const auto faded = lit_runtime();
  faded->options(0, 0, 0, 1, 0.1f);
  ASSERT_EQ(lightloom_update(faded->get(), 1), LIGHTLOOM_OK);
  EXPECT_EQ(faded->irradiance(), plain->irradiance());
}

class UploadTest : public DetailTest {};

TEST_P(UploadTest, TheOldModelLightsUntilTheNewOneIsThere) {
  const auto runtime = lit_runtime();
  runtime->settle();
  const std::vector<Vec3> before = runtime->irradiance();
  lightloom_update_options o{};
  o.struct_size = sizeof o;
  o.upload_bytes = 64;
  ASSERT_EQ(lightloom_set_update_options(runtime->get(), &o), LIGHTLOOM_OK);
  load_cells(*runtime, 1);
  EXPECT_EQ(runtime->counts().active_cells, asset_.manifest.cells.size());
  // The uploads are whole frames before lightloom_update's own.
  ASSERT_EQ(lightloom_update(runtime->get(), 0), LIGHTLOOM_OK);
  EXPECT_EQ(runtime->irradiance(), before);
  EXPECT_EQ(runtime->counts().active_cells, asset_.manifest.cells.size());
  ASSERT_EQ(lightloom_update(runtime->get(), 1), LIGHTLOOM_OK);
  EXPECT_NE(runtime->irradiance(), before);
}

TEST_P(DetailTest, BadArguments) {
  const auto runtime = lit_runtime();
  const Digest& digest = asset_.manifest.cells[0].chunk.digest;
  const std::vector<uint8_t>& bytes = asset_.chunks.at(digest);
  lightloom_detail detail{};
  EXPECT_EQ(lightloom_load_chunk_part(runtime->get(), digest.bytes.data(), bytes.data(), bytes.size(), &detail),
            LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_load_chunk_part(runtime->get(), digest.bytes.data(), bytes.data(), bytes.size(), nullptr),
            LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  detail.struct_size = sizeof detail;
  detail.flags = 2;
  EXPECT_EQ(lightloom_load_chunk_part(runtime->get(), digest.bytes.data(), bytes.data(), bytes.size(), &detail),
            LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  TestRuntime rigid(GetParam());
  lightloom_update_options o{};
  o.struct_size = sizeof o;
  o.fade = 0.5f;
  EXPECT_EQ(lightloom_set_update_options(rigid.get(), &o), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  o.fade = 2;
  EXPECT_EQ(lightloom_set_update_options(runtime->get(), &o), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
}

INSTANTIATE_TEST_SUITE_P(Backends, UploadTest, ::testing::Values(0u), [](const auto&) { return "Vulkan"; });
INSTANTIATE_TEST_SUITE_P(Backends, DetailTest, ::testing::Values(0u, uint32_t{LIGHTLOOM_CREATE_CPU}),
                         [](const auto& test) { return test.param == 0 ? "Vulkan" : "Cpu"; });

}  // namespace
}  // namespace lightloom
