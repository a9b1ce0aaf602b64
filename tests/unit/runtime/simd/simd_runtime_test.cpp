// The SIMD runtime against the CPU decoder, with every set of kernels that this processor runs.
#include "runtime/simd/simd_runtime.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <ostream>
#include <string>

#include "tests/unit/runtime/simd/simd_level.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

using testing::RandomAssetOptions;
using testing::SyntheticAsset;

struct Case {
  const char* name;
  RandomAssetOptions asset;
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
  const SyntheticAsset asset = testing::random_asset(GetParam().asset);
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  const SurfaceLight light = testing::random_light(source->surface_elements(), 7);
  const auto expected = testing::decoded_frames(*source, light, 8);

  const simd::KernelList& sets = simd::available_kernels();
  for (size_t k = 0; k < sets.count; ++k) {
    SimdOptions options;
    options.kernels = sets.sets[k];
    const auto runtime = testing::simd_runtime(*source, options);
    testing::set_light(light, runtime.get());
    for (size_t bounce = 0; bounce < expected.size(); ++bounce) {
      runtime->update();
      EXPECT_LT(testing::largest_error(testing::irradiance(*runtime), expected[bounce]), 1e-4)
          << sets.sets[k]->name << ", bounce " << bounce;
    }
    // From zero again.
    const std::vector<Vec3> eight = testing::irradiance(*runtime);
    runtime->reset_feedback();
    for (size_t bounce = 0; bounce < expected.size(); ++bounce) runtime->update();
    EXPECT_EQ(testing::irradiance(*runtime), eight) << sets.sets[k]->name;
  }
}

// Strides of 8, 16, 40, 56, 64 and 104: whole vectors and half ones; receivers from one a cell to many blocks.
INSTANTIATE_TEST_SUITE_P(
    Simd, AgainstDecoder,
    ::testing::Values(Case{"order0", sized(0, 65, 20, 3, 8)}, Case{"order2", sized(2, 100, 20, 9, 32)},
                      Case{"order4", sized(4, 256, 16, 7, 32)}, Case{"order5", sized(5, 257, 12, 5, 17)},
                      Case{"order6", sized(6, 300, 12, 5, 7)}, Case{"order7", sized(7, 1000, 12, 5, 32)},
                      Case{"order9", sized(9, 300, 12, 3, 20)}, Case{"rank0", sized(3, 64, 8, 2, 0)},
                      Case{"one_receiver_cells", sized(1, 33, 4, 40, 9)},
                      Case{"large_clusters", sized(2, 64, 64, 2, 12)}),
    [](const auto& info) { return std::string(info.param.name); });

TEST(SimdRuntime, ThreadsDoNotChangeABit) {
  RandomAssetOptions options = sized(4, 300, 48, 23, 32);
  options.probes = 61;
  const SyntheticAsset asset = testing::random_asset(options);
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  const SurfaceLight light = testing::random_light(source->surface_elements(), 3);
  std::vector<std::vector<Vec3>> of_one_thread;
  for (const int threads : {1, 2, 3, 8}) {
    SimdOptions simd;
    simd.threads = threads;
    const auto runtime = testing::simd_runtime(*source, simd);
    testing::set_light(light, runtime.get());
    SimdFrameOptions frame;
    frame.max_probes = 13;
    frame.max_cells = 7;
    frame.epsilon = 0.01f;
    for (size_t i = 0; i < 12; ++i) {
      runtime->update(frame);
      if (threads == 1) {
        of_one_thread.push_back(testing::irradiance(*runtime));
      } else {
        ASSERT_EQ(testing::irradiance(*runtime), of_one_thread[i]) << threads << " threads, frame " << i;
      }
    }
  }
}

// Every element emits L and reflects a: E = πL ÷ (1 − a). An albedo of 1 is taken as 0.99.
TEST(SimdRuntime, FurnaceConvergesToTheGeometricSum) {
  RandomAssetOptions options;
  options.closed = true;
  options.order = 7;
  options.relight_rays = 512;
  const SyntheticAsset asset = testing::random_asset(options);
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  const auto runtime = testing::simd_runtime(*source);
  const size_t S = source->surface_elements();
  testing::set_light(
      {std::vector<Vec3>(S), std::vector<Vec3>(S, {0.5f, 0.9f, 1}), std::vector<Vec3>(S, {1, 1, 1}), Vec3{}},
      runtime.get());
  const double pi = 3.14159265358979323846;
  std::vector<Vec3> before(S);
  for (int i = 0; i < 1200; ++i) {
    runtime->update();
    if (i % 100 != 0) continue;
    const std::vector<Vec3> e = testing::irradiance(*runtime);
    for (size_t s = 0; s < S; ++s) ASSERT_GE(e[s].z, before[s].z * (1 - 1e-5f)) << "frame " << i << ", element " << s;
    before = e;
  }
  // 0.99^1200 < 6e-6.
  for (const Vec3 e : testing::irradiance(*runtime)) {
    ASSERT_NEAR(e.x, 2 * pi, 2e-4 * pi);
    ASSERT_NEAR(e.y, 10 * pi, 3e-3 * pi);
    ASSERT_NEAR(e.z, 100 * pi, 0.3 * pi);
  }
}

// An asset that amplifies light, as no baker writes it: B stays within L ÷ (1 − a), the sum of what was emitted.
TEST(SimdRuntime, NoAssetMakesFeedbackDiverge) {
  const SyntheticAsset asset = testing::random_asset({});
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  const auto runtime = testing::simd_runtime(*source);
  for (uint32_t c = 0; c < source->manifest().cells.size(); ++c) {
    SourceCell cell = *source->cell(c);
    for (CellChunk::Cluster& cluster : cell.chunk.clusters) {
      std::fill(cluster.reconstruction.begin(), cluster.reconstruction.end(), Half{0x7bff});  // 65504
    }
    runtime->unload_cell(c);
    ASSERT_TRUE(runtime->load_cell(c, runtime->pack_cell(cell)).ok());
  }
  const size_t S = source->surface_elements();
  testing::set_light(
      {std::vector<Vec3>(S), std::vector<Vec3>(S, {0.5f, 0.9f, 0}), std::vector<Vec3>(S, {1, 1, 1}), Vec3{}},
      runtime.get());
  for (int i = 0; i < 300; ++i) runtime->update();
  const float pi = 3.14159265f;
  float most = 0;
  for (const Vec3 e : testing::irradiance(*runtime)) {
    ASSERT_LE(std::abs(e.x), 2 * pi * 1.0001f);
    ASSERT_LE(std::abs(e.y), 10 * pi * 1.0001f);
    ASSERT_LE(std::abs(e.z), pi * 1.0001f);
    most = std::max(most, std::abs(e.y));
  }
  EXPECT_GT(most, 9 * pi) << "the asset does not amplify";
}

TEST(SimdRuntime, EmptyAssetIsNoError) {
  const SyntheticAsset asset = testing::empty_asset(4, 16);
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  const auto runtime = testing::simd_runtime(*source);
  runtime->set_environment({1, 1, 1});
  EXPECT_EQ(runtime->update().updated_cells, 0u);
  EXPECT_TRUE(runtime->update().skipped);
  EXPECT_EQ(runtime->counts().surface_elements, 0u);
}

TEST(SimdRuntime, StatsCountBytesAndTimes) {
  const SyntheticAsset asset = testing::random_asset({});
  const auto source = asset.open();
  ASSERT_TRUE(source.ok()) << source.status();
  SimdOptions options;
  static double clock = 0;
  options.milliseconds = [] { return clock += 1; };
  const auto runtime = testing::simd_runtime(*source, options);
  testing::set_light(testing::random_light(source->surface_elements(), 1), runtime.get());
  const SimdStats stats = runtime->update();
  uint64_t projection = 0, reconstruction = 0;
  const auto decoder = load_decoder_asset(*source);
  for (const SourceCell& cell : decoder->cells) {
    for (const CellChunk::Cluster& c : cell.chunk.clusters) {
      projection += 2 * c.projection.size();
      reconstruction += 2 * c.reconstruction.size();
    }
    reconstruction += kNearTexelBytes * cell.chunk.near_texels.size();
  }
  EXPECT_EQ(stats.frames, 1u);
  EXPECT_EQ(stats.relight_bytes, 24u * 200 * 4);
  EXPECT_EQ(stats.project_bytes, projection);
  EXPECT_EQ(stats.receive_bytes, reconstruction);
  // The clock is read once more than there are laps; two of them are selection.
  EXPECT_EQ(stats.radiosity_ms, 1);
  EXPECT_EQ(stats.select_ms, 2);
  EXPECT_EQ(stats.relight_ms, 1);
  EXPECT_EQ(stats.project_ms, 1);
  EXPECT_EQ(stats.receive_ms, 1);
}

}  // namespace
}  // namespace lightloom
