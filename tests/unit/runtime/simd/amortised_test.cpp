// What a frame may leave out: nothing that matters, and in the end nothing at all.
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <set>

#include "tests/unit/runtime/simd/simd_level.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

constexpr int kManyFrames = 400;

class Amortised : public ::testing::Test {
 protected:
  Amortised() {
    testing::RandomAssetOptions options;
    options.side = 40;
    options.probes = 60;
    options.cells = 25;
    options.relight_rays = 40;  // few enough that no probe sees every tile
    asset_ = testing::random_asset(options);
    source_.emplace(*asset_.open());
    light_ = testing::random_light(source_->surface_elements(), 3);
  }
  std::unique_ptr<SimdRuntime> lit(const SimdOptions& options = {}) {
    auto runtime = testing::simd_runtime(*source_, options);
    testing::set_light(light_, runtime.get());
    return runtime;
  }
  /// Until nothing changes any more.
  static void settle(SimdRuntime* runtime, const SimdFrameOptions& frame = {}) {
    for (int i = 0; i < kManyFrames; ++i) {
      if (runtime->update(frame).skipped) return;
    }
    FAIL() << "frames still change after " << kManyFrames;
  }

  testing::SyntheticAsset asset_;
  std::optional<AssetSource> source_;
  SurfaceLight light_;
};

TEST_F(Amortised, NoChangeNoWork) {
  const auto runtime = lit();
  settle(runtime.get());
  testing::set_light(light_, runtime.get());  // the same again
  const SimdStats stats = runtime->update();
  EXPECT_TRUE(stats.skipped);
  EXPECT_EQ(stats.radiosity_tiles, 0u);
  EXPECT_EQ(stats.updated_probes, 0u);
  EXPECT_EQ(stats.updated_cells, 0u);
  EXPECT_EQ(stats.project_bytes, 0u);
}

TEST_F(Amortised, OnlyProbesThatSeeTheChangeAreRelit) {
  const auto runtime = lit();
  settle(runtime.get());
  // Element 130, of tile 2.
  const Vec3 bright{50, 50, 50};
  runtime->set_emission(130, std::span(&bright.x, 3));
  const SimdStats stats = runtime->update();
  EXPECT_EQ(stats.radiosity_tiles, 1u);
  EXPECT_EQ(stats.changed_tiles, 1u);

  std::set<uint32_t> seeing;
  for (uint32_t p = 0; p < source_->manifest().probes.size(); ++p) {
    const auto rays = *source_->relight(p);
    for (const uint32_t element : rays) {
      if (element / 64 == 2) seeing.insert(p);
    }
  }
  EXPECT_LT(seeing.size(), source_->manifest().probes.size());
  EXPECT_EQ(stats.updated_probes, seeing.size());
}

TEST_F(Amortised, SkyConcernsOnlyProbesThatSeeIt) {
  const auto runtime = lit();
  settle(runtime.get());
  runtime->set_environment({2, 2, 2});
  uint32_t seeing = 0;
  for (uint32_t p = 0; p < source_->manifest().probes.size(); ++p) {
    const auto rays = *source_->relight(p);
    seeing += std::find(rays.begin(), rays.end(), RelightChunk::kSky) != rays.end();
  }
  const SimdStats stats = runtime->update();
  EXPECT_EQ(stats.radiosity_tiles, 0u);
  EXPECT_EQ(stats.updated_probes, seeing);
}

TEST_F(Amortised, BudgetsHoldAndEndAtTheSameLight) {
  const auto at_once = lit(), in_turn = lit();
  settle(at_once.get());
  SimdFrameOptions frame;
  frame.max_probes = 7;
  frame.max_cells = 4;
  bool waited = false;
  for (int i = 0; i < 20; ++i) {
    const SimdStats stats = in_turn->update(frame);
    EXPECT_LE(stats.updated_probes, 7u);
    EXPECT_LE(stats.updated_cells, 4u);
    waited |= stats.waiting_probes > 0 && stats.waiting_cells > 0;
  }
  EXPECT_TRUE(waited);
  for (int i = 0; i < 20 * kManyFrames && !in_turn->update(frame).skipped;) ++i;
  EXPECT_LT(testing::largest_error(testing::irradiance(*in_turn), testing::irradiance(*at_once)), 1e-5);
}

TEST_F(Amortised, EpsilonBoundsWhatIsLost) {
  const auto exact = lit(), rough = lit();
  settle(exact.get());
  SimdFrameOptions frame;
  frame.epsilon = 0.01f;
  frame.epsilon_floor = 0.01f;
  int frames = 0;
  while (!rough->update(frame).skipped) ASSERT_LT(++frames, kManyFrames);
  // B is within 1 % everywhere, and what comes back from it is at most about as much again.
  const double error = testing::largest_error(testing::irradiance(*rough), testing::irradiance(*exact));
  EXPECT_LT(error, 0.05);
  EXPECT_GT(error, 0) << "epsilon had no effect";
}

TEST_F(Amortised, SmallChangesAddUp) {
  const auto runtime = lit();
  SimdFrameOptions frame;
  frame.epsilon = 0.1f;
  settle(runtime.get(), frame);
  // 2 % more each frame: after a few it is more than 10 % away from what the probes saw.
  Vec3 emission = light_.emission[0];
  ASSERT_GT(emission.x, 0);
  int relit = 0;
  for (int i = 0; i < 12; ++i) {
    emission = emission * 1.02f;
    runtime->set_emission(0, std::span(&emission.x, 3));
    relit += runtime->update(frame).changed_tiles > 0;
  }
  EXPECT_GE(relit, 1);
  EXPECT_LE(relit, 4);
}

TEST_F(Amortised, SmoothingApproachesTheSameLightStepByStep) {
  SimdOptions options;
  options.smoothing = true;
  const auto at_once = lit(), smooth = lit(options);
  settle(at_once.get());
  settle(smooth.get());
  EXPECT_EQ(testing::irradiance(*smooth), testing::irradiance(*at_once)) << "smoothing is off until a frame asks";

  // A sky three times as bright, and no feedback.
  for (SimdRuntime* r : {at_once.get(), smooth.get()}) {
    r->set_albedo(0, std::vector<float>(size_t{3} * source_->surface_elements()));
    settle(r);
  }
  const std::vector<Vec3> before = testing::irradiance(*smooth);
  for (SimdRuntime* r : {at_once.get(), smooth.get()}) r->set_environment(light_.environment * 3);
  settle(at_once.get());
  const std::vector<Vec3> after = testing::irradiance(*at_once);
  SimdFrameOptions frame;
  frame.smoothing = 0.25f;
  float left = 1;
  for (int i = 0; i < 5; ++i) {
    smooth->update(frame);
    left *= 0.75f;
    const std::vector<Vec3> now = testing::irradiance(*smooth);
    for (size_t s = 0; s < now.size(); ++s) {
      const float expected = after[s].x + left * (before[s].x - after[s].x);
      ASSERT_NEAR(now[s].x, expected, 1e-3f * std::abs(after[s].x) + 1e-5f) << "frame " << i << ", element " << s;
    }
  }
  settle(smooth.get(), frame);
  EXPECT_EQ(testing::irradiance(*smooth), after);
}

TEST_F(Amortised, SmoothingMayBeSwitchedOffOnTheWay) {
  SimdOptions options;
  options.smoothing = true;
  const auto at_once = lit(), smooth = lit(options);
  settle(at_once.get());
  SimdFrameOptions frame;
  frame.smoothing = 0.3f;
  for (int i = 0; i < 4; ++i) smooth->update(frame);
  settle(smooth.get());
  EXPECT_LT(testing::largest_error(testing::irradiance(*smooth), testing::irradiance(*at_once)), 1e-5);
}

}  // namespace
}  // namespace lightloom
