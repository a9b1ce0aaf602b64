// What each pass of the Vulkan runtime costs, beside the best bare matrix shaders over as many bytes in the same run; and
// what a frame costs when only a part of the light changes.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "tests/bench/bare_shaders.h"
#include "tests/bench/bench_asset.h"
#include "tests/bench/repeated_dispatch.h"
#include "tests/unit/runtime/test_engine.h"

namespace lightloom {
namespace {

using bench::RepeatedPass;

constexpr int kRepeats = 9;

/// Milliseconds of all threads.
template <class F>
double cpu_ms(F f) {
  const double start = bench::process_cpu_seconds();
  f();
  return 1e3 * (bench::process_cpu_seconds() - start);
}

void adjust(const lightloom_vulkan_device& device, lightloom_vulkan_create_info* info) {
  info->frames_in_flight = 1;
  if (const char* const size = std::getenv("LIGHTLOOM_BENCH_WORKGROUP")) {
    info->workgroup_size = static_cast<uint32_t>(std::atoi(size));
  }
  bench::repeat_dispatches(device, info);
}

/// An engine with the asset, lit.
class LitEngine : public testing::Engine {
 public:
  LitEngine() : Engine(VK_FORMAT_UNDEFINED, 0, adjust) {
    load(asset_, asset_.manifest);
    light_ = testing::random_light(counts().surface_elements, 1);
    light(light_);
    while (counts().pending_bytes > 0) frame();
  }
  /// Every radiance, so every probe and cell.
  void change_everything() {
    bright_ = !bright_;
    for (Vec3& e : light_.emission) e = bright_ ? e * 2.0f + Vec3{1, 1, 1} : (e - Vec3{1, 1, 1}) * 0.5f;
    EXPECT_EQ(lightloom_set_emission(runtime(), &light_.emission[0].x, 0, light_.emission.size()), LIGHTLOOM_OK);
    frame();
  }
  /// Every cell, but no probe: B is what it was.
  void recompute_cells() {
    EXPECT_EQ(lightloom_reset_feedback(runtime()), LIGHTLOOM_OK);
    frame();
  }
  std::vector<Vec3>& direct() { return light_.direct; }

 private:
  bench::BenchAsset asset_ = bench::bench_asset();
  SurfaceLight light_;
  bool bright_ = false;
};

/// The fastest of its kind here and now.
std::unique_ptr<bench::BareShader> best_bare(LitEngine& engine, uint32_t columns, uint64_t bytes) {
  std::unique_ptr<bench::BareShader> best;
  double rate = 0;
  for (auto& shader : bench::bare_shaders(&engine.context(), &engine.queue(), columns, bytes)) {
    std::vector<double> runs;
    for (int i = 0; i < 5; ++i) runs.push_back(shader->gb_per_cpu_second());
    if (const double r = bench::spread(runs).most; r > rate) rate = r, best = std::move(shader);
  }
  std::fprintf(stderr, "best bare shader with %u columns over %.1f MB: %s\n", columns,
               1e-6 * static_cast<double>(bytes), best->name().c_str());
  return best;
}

/// What `pass` costs, in turn with the bare shaders so that all see the same machine: the difference of frames that
/// dispatch it once and several times.
template <class Frame>
bench::PassSamples measure(RepeatedPass pass, uint32_t more, Frame frame,
                           const std::vector<std::unique_ptr<bench::BareShader>>& bare) {
  bench::PassSamples samples{};
  samples.path = "Vulkan";
  frame();  // nothing of what went before is left to do
  for (int i = 0; i < kRepeats; ++i) {
    if (!bare.empty()) {
      samples.bare_gb_per_s.push_back(bare[0]->gb_per_cpu_second());
      samples.bare_rgb_gb_per_s.push_back(bare[1]->gb_per_cpu_second());
    }
    bench::repeat_pass(RepeatedPass::kNone, 0);
    const double once = cpu_ms(frame);
    bench::repeat_pass(pass, more);
    samples.cpu_ms.push_back((cpu_ms(frame) - once) / more);
  }
  bench::repeat_pass(RepeatedPass::kNone, 0);
  return samples;
}

bench::PassSamples measure_cells(LitEngine& engine, RepeatedPass pass, uint32_t more, uint64_t bytes) {
  std::vector<std::unique_ptr<bench::BareShader>> bare;
  for (const uint32_t columns : {1u, 3u}) bare.push_back(best_bare(engine, columns, bytes));
  return measure(
      pass, more, [&] { engine.recompute_cells(); }, bare);
}

TEST(VulkanBench, PassesAgainstBareShaders) {
  LitEngine engine;
  engine.change_everything();
  engine.frame();
  lightloom_stats stats = engine.stats();
  const lightloom_counts counts = engine.counts();
  ASSERT_EQ(stats.updated_probes, counts.probes);
  ASSERT_EQ(stats.updated_cells, counts.active_cells);
  std::printf("%s; %u surface elements, %u probes, %u cells, %u clusters\n\n", engine.device_name().c_str(),
              counts.surface_elements, counts.probes, counts.cells, counts.clusters);
  const uint64_t relight_bytes = stats.relight_bytes;
  engine.recompute_cells();
  engine.recompute_cells();
  engine.frame();
  stats = engine.stats();
  ASSERT_EQ(stats.updated_probes, 0u);
  ASSERT_EQ(stats.updated_cells, counts.active_cells);
  bench::print_pass_header();

  bench::PassSamples project = measure_cells(engine, RepeatedPass::kProject, 4, stats.project_bytes);
  project.pass = "project";
  project.bytes = stats.project_bytes;
  bench::print_pass(project);
  bench::PassSamples receive = measure_cells(engine, RepeatedPass::kReceive, 40, stats.receive_bytes);
  receive.pass = "receive";
  receive.bytes = stats.receive_bytes;
  bench::print_pass(receive);
  bench::PassSamples relight = measure(RepeatedPass::kRelight, 1, [&] { engine.change_everything(); }, {});
  relight.pass = "relight";
  relight.bytes = relight_bytes;
  bench::print_pass(relight);
}

TEST(VulkanBench, FrameAgainstShareOfTheLightThatChanges) {
  LitEngine engine;
  lightloom_update_options options{};
  options.struct_size = sizeof options;
  options.epsilon = options.epsilon_floor = bench::kEpsilon;
  ASSERT_EQ(lightloom_set_update_options(engine.runtime(), &options), LIGHTLOOM_OK);
  const auto settle = [&] {
    for (int i = 0; i < 100 && engine.stats().skipped == 0; ++i) engine.frame();
  };
  settle();
  bench::print_frame_header();
  std::vector<Vec3>& direct = engine.direct();
  for (const double share : bench::kShares) {
    const size_t count = static_cast<size_t>(share * static_cast<double>(direct.size()));
    for (size_t s = 0; s < count; ++s) direct[s] = direct[s] * 1.5f + Vec3{1, 1, 1};
    const double set_ms =
        cpu_ms([&] { EXPECT_EQ(lightloom_set_direct(engine.runtime(), &direct[0].x, 0, count), LIGHTLOOM_OK); });
    const double frame_ms = cpu_ms([&] { engine.frame(); });
    engine.frame();
    const lightloom_stats s = engine.stats();
    bench::print_frame({"Vulkan", share, set_ms, frame_ms, s.changed_tiles, s.updated_probes, s.updated_cells});
    settle();
  }
}

}  // namespace
}  // namespace lightloom
