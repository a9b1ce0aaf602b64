// The Vulkan passes against the CPU decoder, with core and synchronization validation. Not one validation
// message is tolerated, those of destruction (leaks) included.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <ostream>
#include <string>
#include <vector>

#include "runtime/decoder.h"
#include "runtime/include/lightloom.h"
#include "tests/unit/runtime/synthetic_asset.h"
#include "tests/unit/runtime/test_runtime.h"

namespace lightloom {
namespace {

using testing::joined;
using testing::p999_error;
using testing::RandomAssetOptions;
using testing::Received;
using testing::SyntheticAsset;
using testing::TestRuntime;

struct Case {
  const char* name;
  RandomAssetOptions asset;
  uint32_t flags = 0;
  uint64_t page_bytes = 0;
  uint32_t max_workgroups = 0;
  uint32_t workgroup_size = 0;
  uint64_t staging_bytes = 0;
};
void PrintTo(const Case& c, std::ostream* out) { *out << c.name; }

RandomAssetOptions sized(int order, int rays, uint32_t side, uint32_t cells, uint32_t max_rank) {
  RandomAssetOptions o;
  o.order = order;
  o.relight_rays = rays;
  o.side = side;
  o.cells = cells;
  o.max_rank = max_rank;
  o.seed = static_cast<uint64_t>(order);
  return o;
}

class AgainstDecoder : public ::testing::TestWithParam<Case> {};

TEST_P(AgainstDecoder, EightBouncesAgree) {
  const Case& param = GetParam();
  SyntheticAsset asset = testing::random_asset(param.asset);
  const auto decoder = load_decoder_asset(*asset.open());
  ASSERT_TRUE(decoder.ok()) << decoder.status();
  const SurfaceLight light = testing::random_light(decoder->surface_elements, 7);

  TestRuntime runtime(param.flags, param.page_bytes, param.max_workgroups, param.workgroup_size, param.staging_bytes);
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK) << joined(runtime.received().errors);
  if (param.page_bytes != 0) {
    EXPECT_GT(runtime.counts().pages, 2u);
  }
  runtime.light(light);

  std::vector<Vec3> expected(decoder->surface_elements);
  for (int bounce = 1; bounce <= 8; ++bounce) {
    expected = decode_frame(*decoder, light, expected).irradiance;
    ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
    // Float rounding, far below the 0.5 % that is promised.
    EXPECT_LT(p999_error(runtime.irradiance(), expected), 1e-4) << "bounce " << bounce;
  }
  // All bounces in one call, over more than one submission, and from zero again.
  const std::vector<Vec3> eight = runtime.irradiance();
  ASSERT_EQ(lightloom_reset_feedback(runtime.get()), LIGHTLOOM_OK);
  ASSERT_EQ(lightloom_update(runtime.get(), 8), LIGHTLOOM_OK);
  EXPECT_EQ(runtime.irradiance(), eight);
}

INSTANTIATE_TEST_SUITE_P(
    Lavapipe, AgainstDecoder,
    ::testing::Values(Case{"order2", sized(2, 100, 20, 9, 32)}, Case{"order4", sized(4, 256, 16, 7, 32)},
                      Case{"order7", sized(7, 1000, 12, 5, 32)}, Case{"order9", sized(9, 300, 12, 3, 20)},
                      Case{"rank0", sized(3, 64, 8, 2, 0)}, Case{"one_receiver_cells", sized(1, 33, 4, 40, 9)},
                      Case{"pages", sized(4, 256, 20, 12, 32), 0, 48 << 10},
                      Case{"few_workgroups", sized(4, 256, 16, 7, 32), 0, 0, 3},
                      Case{"little_staging", sized(4, 256, 20, 12, 32), 0, 0, 0, 0, 4096},
                      Case{"workgroup8", sized(9, 300, 12, 3, 20), 0, 0, 3, 8},
                      Case{"workgroup16", sized(4, 100, 16, 7, 32), 0, 48 << 10, 0, 16},
                      Case{"workgroup32", sized(7, 200, 12, 5, 32), 0, 0, 0, 32}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(Vulkan, FurnaceConvergesToTheGeometricSum) {
  RandomAssetOptions options;
  options.closed = true;
  options.order = 7;
  options.relight_rays = 512;
  SyntheticAsset asset = testing::random_asset(options);
  TestRuntime runtime;
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK) << joined(runtime.received().errors);
  const size_t S = runtime.counts().surface_elements;
  SurfaceLight light;
  light.direct.assign(S, {});
  light.albedo.assign(S, {0.5f, 0.9f, 0});
  light.emission.assign(S, {1, 1, 2});
  runtime.light(light);
  ASSERT_EQ(lightloom_update(runtime.get(), 150), LIGHTLOOM_OK);
  const double pi = 3.14159265358979323846;
  // E = πL ÷ (1 − a); 0.9^150 < 2e-7.
  for (const Vec3 e : runtime.irradiance()) {
    EXPECT_NEAR(e.x, 2 * pi, 2e-4);
    EXPECT_NEAR(e.y, 10 * pi, 1e-2);
    EXPECT_NEAR(e.z, 2 * pi, 2e-4);
  }
}

TEST(Vulkan, FeedbackAtHighAlbedoIsMonotoneAndBounded) {
  RandomAssetOptions options;
  options.closed = true;
  options.order = 2;
  options.relight_rays = 64;
  SyntheticAsset asset = testing::random_asset(options);
  TestRuntime runtime;
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK) << joined(runtime.received().errors);
  const size_t S = runtime.counts().surface_elements;
  SurfaceLight light;
  light.direct.assign(S, {});
  light.albedo.assign(S, {0.5f, 0.9f, 0.99f});
  light.emission.assign(S, {1, 1, 1});
  runtime.light(light);
  Vec3 before{};
  for (int step = 0; step < 12; ++step) {
    ASSERT_EQ(lightloom_update(runtime.get(), 50), LIGHTLOOM_OK);
    const Vec3 e = runtime.irradiance()[0];
    for (int c = 0; c < 3; ++c) EXPECT_GE(e[c], before[c] * 0.99999f);
    before = e;
  }
  // E = πL ÷ (1 − a); 0.99^600 = 0.0024.
  for (const Vec3 e : runtime.irradiance()) {
    EXPECT_NEAR(e.x, 6.2832, 0.02 * 6.2832);
    EXPECT_NEAR(e.y, 31.416, 0.02 * 31.416);
    EXPECT_NEAR(e.z, 314.16, 0.02 * 314.16);
  }
  // Albedo 1 has no finite sum; it is taken as LIGHTLOOM_MAX_ALBEDO.
  light.albedo.assign(S, {1, 1, 1});
  runtime.light(light);
  ASSERT_EQ(lightloom_update(runtime.get(), 500), LIGHTLOOM_OK);
  for (const Vec3 e : runtime.irradiance()) EXPECT_LT(e.x, 1.001f * 314.16f);
}

class HostileAsset : public ::testing::TestWithParam<uint32_t> {};

/// |E| ≤ π·C ÷ (1 − 0.99), C ≤ 0.99·20/π + 5, whatever the clusters hold.
void expect_bounded(uint32_t device, const std::function<void(CellChunk::Cluster*)>& edit) {
  SyntheticAsset asset = testing::random_asset({});
  for (CellEntry& cell : asset.manifest.cells) {
    CellChunk chunk = *decode_cell(asset.chunks.at(cell.chunk.digest));
    for (CellChunk::Cluster& c : chunk.clusters) edit(&c);
    cell.chunk = asset.put(encode_cell(chunk));
  }
  TestRuntime runtime(device);
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK) << joined(runtime.received().errors);
  const size_t S = runtime.counts().surface_elements;
  SurfaceLight light = testing::random_light(static_cast<uint32_t>(S), 7);
  light.albedo.assign(S, {0.99f, 0.99f, 0.99f});
  light.environment = {1, 1, 1};
  runtime.light(light);
  ASSERT_EQ(lightloom_update(runtime.get(), 1000), LIGHTLOOM_OK);
  for (const Vec3 e : runtime.irradiance()) {
    for (int c = 0; c < 3; ++c) EXPECT_LE(std::abs(e[c]), 3.1416f * 11.31f * 100.1f);
  }
}

TEST_P(HostileAsset, LargeCoefficientsDoNotMakeFeedbackDiverge) {
  expect_bounded(GetParam(), [](CellChunk::Cluster* c) {
    for (Half& h : c->reconstruction) h = float_to_half(1e4f * half_to_float(h));
  });
}

TEST_P(HostileAsset, InfinitiesThatCancelDoNotMakeItNan) {
  expect_bounded(GetParam(), [](CellChunk::Cluster* c) {
    for (size_t k = 0; k < c->correction.size(); ++k) {
      c->correction[k] = 3e38f;
      const size_t column = c->reconstruction.size() / c->correction.size();
      for (size_t r = 0; r < column; ++r)
        c->reconstruction[k * column + r] = float_to_half(k % 2 == 0 ? 100.0f : -100.0f);
    }
  });
}

INSTANTIATE_TEST_SUITE_P(Devices, HostileAsset, ::testing::Values(0u, uint32_t{LIGHTLOOM_CREATE_CPU}),
                         [](const auto& param) { return param.param == 0 ? "Vulkan" : "Simd"; });

TEST(Vulkan, StatsCountFramesTimeAndBytes) {
  SyntheticAsset asset = testing::random_asset({});
  TestRuntime runtime;
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK);
  runtime.light(testing::random_light(runtime.counts().surface_elements, 1));
  ASSERT_EQ(lightloom_update(runtime.get(), 9), LIGHTLOOM_OK);
  lightloom_stats stats{};
  stats.struct_size = sizeof stats;
  ASSERT_EQ(lightloom_get_stats(runtime.get(), &stats), LIGHTLOOM_OK);
  EXPECT_EQ(stats.frames, 9u);
  EXPECT_EQ(stats.updated_probes, 24u);
  EXPECT_EQ(stats.updated_cells, 7u);
  EXPECT_EQ(stats.relight_bytes, 24u * 200 * 4);
  EXPECT_GT(stats.project_bytes, 0u);
  EXPECT_GT(stats.receive_bytes, 0u);
  if (stats.timestamps != 0) {
    EXPECT_GT(stats.radiosity_ms, 0);
    EXPECT_GT(stats.relight_ms, 0);
    EXPECT_GT(stats.project_ms, 0);
    EXPECT_GT(stats.receive_ms, 0);
  }
  // A caller built against an older, shorter struct: nothing behind it is written.
  lightloom_stats old{};
  old.struct_size = 16;
  old.upload_ms = 77;
  ASSERT_EQ(lightloom_get_stats(runtime.get(), &old), LIGHTLOOM_OK);
  EXPECT_EQ(old.frames, 9u);
  EXPECT_EQ(old.struct_size, 16u);
  EXPECT_EQ(old.upload_ms, 77);
}

TEST(Vulkan, CountsAreTheAssets) {
  SyntheticAsset asset = testing::random_asset({});
  TestRuntime runtime;
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK);
  const lightloom_counts c = runtime.counts();
  EXPECT_EQ(c.surface_elements, asset.open()->surface_elements());
  EXPECT_EQ(c.receivers, c.surface_elements * 9 / 10);
  EXPECT_EQ(c.probes, 24u);
  EXPECT_EQ(c.cells, 7u);
  EXPECT_EQ(c.clusters, asset.manifest.clusters.size());
  EXPECT_EQ(c.pages, 1u);
  EXPECT_EQ(c.sh_order, 4u);
  EXPECT_GT(c.gpu_bytes, 0u);
}

TEST(Vulkan, EmptyAssetIsNoError) {
  SyntheticAsset asset = testing::empty_asset(4, 16);
  TestRuntime runtime;
  ASSERT_EQ(runtime.load(asset), LIGHTLOOM_OK) << joined(runtime.received().errors);
  EXPECT_EQ(lightloom_update(runtime.get(), 2), LIGHTLOOM_OK);
  EXPECT_EQ(runtime.counts().surface_elements, 0u);
}

TEST(Vulkan, LoadReplacesTheAssetAndItsFeedback) {
  SyntheticAsset first = testing::random_asset({});
  RandomAssetOptions options;
  options.order = 2;
  options.seed = 9;
  SyntheticAsset second = testing::random_asset(options);
  TestRuntime runtime;
  ASSERT_EQ(runtime.load(first), LIGHTLOOM_OK);
  runtime.light(testing::random_light(runtime.counts().surface_elements, 1));
  ASSERT_EQ(lightloom_update(runtime.get(), 3), LIGHTLOOM_OK);
  ASSERT_EQ(runtime.load(second), LIGHTLOOM_OK);
  // Inputs start at 0 again.
  ASSERT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_OK);
  const std::vector<Vec3> dark = runtime.irradiance();
  EXPECT_TRUE(std::all_of(dark.begin(), dark.end(), [](Vec3 e) { return e == Vec3{}; }));
  lightloom_unload(runtime.get());
  EXPECT_EQ(lightloom_update(runtime.get(), 1), LIGHTLOOM_ERROR_NO_ASSET);
}

class ErrorTest : public ::testing::Test {
 protected:
  SyntheticAsset asset_ = testing::random_asset({});
  TestRuntime runtime_;

  /// The runtime says so in one line, holds no asset, and still loads a good one.
  void expect_load_fails(SyntheticAsset& asset, const std::vector<uint8_t>& manifest, lightloom_result result) {
    EXPECT_EQ(runtime_.load(asset, manifest), result) << joined(runtime_.received().errors);
    EXPECT_EQ(runtime_.received().errors.size(), 1u);
    EXPECT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_ERROR_NO_ASSET);
    SyntheticAsset good = testing::random_asset({});
    EXPECT_EQ(runtime_.load(good), LIGHTLOOM_OK);
    EXPECT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_OK);
  }
};

TEST_F(ErrorTest, CorruptManifest) {
  std::vector<uint8_t> manifest = encode_manifest(asset_.manifest);
  manifest[manifest.size() / 2] ^= 1;
  expect_load_fails(asset_, manifest, LIGHTLOOM_ERROR_CORRUPT_ASSET);
}

TEST_F(ErrorTest, CorruptChunkOfEachKind) {
  for (const Digest& digest :
       {asset_.manifest.objects.back().surface.digest, asset_.manifest.probes.back().relight.digest,
        asset_.manifest.cells.back().chunk.digest}) {
    SyntheticAsset bad = asset_;
    bad.chunks[digest].back() ^= 0x40;
    EXPECT_EQ(runtime_.load(bad), LIGHTLOOM_ERROR_CORRUPT_ASSET);
    EXPECT_EQ(lightloom_update(runtime_.get(), 1), LIGHTLOOM_ERROR_NO_ASSET);
  }
}

TEST_F(ErrorTest, ReceiverOfTwoCells) {
  asset_.manifest.cells[1] = asset_.manifest.cells[0];
  asset_.manifest.cells.resize(2);
  asset_.manifest.clusters.resize(asset_.manifest.cells[0].clusters);
  asset_.manifest.clusters.insert(asset_.manifest.clusters.end(), asset_.manifest.clusters.begin(),
                                  asset_.manifest.clusters.end());
  asset_.manifest.cells[1].first_cluster = asset_.manifest.cells[0].clusters;
  expect_load_fails(asset_, encode_manifest(asset_.manifest), LIGHTLOOM_ERROR_CORRUPT_ASSET);
}

TEST_F(ErrorTest, MissingChunk) {
  asset_.chunks.erase(asset_.manifest.cells.back().chunk.digest);
  expect_load_fails(asset_, encode_manifest(asset_.manifest), LIGHTLOOM_ERROR_READ_FAILED);
}

TEST(Vulkan, CellLargerThanAPage) {
  SyntheticAsset asset = testing::random_asset({});
  TestRuntime runtime(0, 4096);
  EXPECT_EQ(runtime.load(asset), LIGHTLOOM_ERROR_UNSUPPORTED_ASSET);
}

TEST_F(ErrorTest, ArgumentsAreChecked) {
  ASSERT_EQ(runtime_.load(asset_), LIGHTLOOM_OK);
  const size_t S = runtime_.counts().surface_elements;
  std::vector<float> values(3 * S, 0.5f);
  lightloom_runtime* const r = runtime_.get();
  EXPECT_EQ(lightloom_set_albedo(r, values.data(), 0, S), LIGHTLOOM_OK);
  EXPECT_EQ(lightloom_set_albedo(r, values.data(), S - 1, 1), LIGHTLOOM_OK);
  EXPECT_EQ(lightloom_set_albedo(r, values.data(), 1, S), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_set_albedo(r, values.data(), S + 1, 0), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_set_albedo(r, nullptr, 0, S), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_set_environment(r, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_read_irradiance(r, values.data(), S + 1), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_load(r, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_get_counts(r, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  values[5] = 1.01f;
  EXPECT_EQ(lightloom_set_albedo(r, values.data(), 0, S), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_set_direct(r, values.data(), 0, S), LIGHTLOOM_OK);
  values[5] = NAN;
  EXPECT_EQ(lightloom_set_direct(r, values.data(), 0, S), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_set_emission(r, values.data(), 0, S), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  EXPECT_EQ(lightloom_set_environment(r, values.data() + 3), LIGHTLOOM_ERROR_INVALID_ARGUMENT);

  EXPECT_EQ(lightloom_update(nullptr, 1), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  lightloom_destroy(nullptr);
  lightloom_unload(nullptr);
  EXPECT_EQ(lightloom_create(nullptr, nullptr), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
  lightloom_create_info info{};
  lightloom_runtime* out = r;
  EXPECT_EQ(lightloom_create(&info, &out), LIGHTLOOM_ERROR_INVALID_ARGUMENT);  // struct_size 0
  EXPECT_EQ(out, nullptr);
  info.struct_size = sizeof info;
  info.flags = 1u << 31;
  EXPECT_EQ(lightloom_create(&info, &out), LIGHTLOOM_ERROR_INVALID_ARGUMENT);
}

/// Sets an environment variable until the end of the scope.
class ScopedEnvironment {
 public:
  ScopedEnvironment(const char* name, const char* value) : name_(name) {
    const char* old = std::getenv(name);
    if (old != nullptr) old_ = old;
    had_ = old != nullptr;
    setenv(name, value, 1);
  }
  ~ScopedEnvironment() {
    if (had_) {
      setenv(name_, old_.c_str(), 1);
    } else {
      unsetenv(name_);
    }
  }

 private:
  const char* name_;
  std::string old_;
  bool had_ = false;
};

TEST(Vulkan, NoDriverIsNoDevice) {
  const ScopedEnvironment drivers("VK_ICD_FILENAMES", "/nonexistent.json");
  Received received;
  lightloom_create_info info{};
  info.struct_size = sizeof info;
  info.message = Received::add;
  info.message_user = &received;
  lightloom_runtime* runtime = nullptr;
  EXPECT_EQ(lightloom_create(&info, &runtime), LIGHTLOOM_ERROR_NO_DEVICE);
  EXPECT_EQ(runtime, nullptr);
  EXPECT_EQ(received.errors.size(), 1u);
}

TEST(Vulkan, NoValidationLayerIsAMissingFeature) {
  const ScopedEnvironment layers("VK_LAYER_PATH", "/nonexistent");
  lightloom_create_info info{};
  info.struct_size = sizeof info;
  info.flags = LIGHTLOOM_CREATE_VALIDATION;
  lightloom_runtime* runtime = nullptr;
  EXPECT_EQ(lightloom_create(&info, &runtime), LIGHTLOOM_ERROR_MISSING_FEATURE);
  EXPECT_EQ(runtime, nullptr);
}

TEST(Api, EveryResultHasItsOwnText) {
  std::vector<std::string> texts;
  for (int r = LIGHTLOOM_OK; r >= LIGHTLOOM_ERROR_NOT_READY; --r) {
    texts.push_back(lightloom_result_string(static_cast<lightloom_result>(r)));
  }
  std::sort(texts.begin(), texts.end());
  EXPECT_EQ(std::unique(texts.begin(), texts.end()), texts.end());
  EXPECT_STREQ(lightloom_result_string(static_cast<lightloom_result>(5)), "unknown result");
}

}  // namespace
}  // namespace lightloom

extern "C" int c99_program(void);

TEST(Api, WorksFromC99) { EXPECT_EQ(c99_program(), 0); }
