// What each pass of the Vulkan runtime costs, beside the best bare matrix shaders over as many bytes in the same run; and
// what a frame costs when only a part of the light changes.
#include <gtest/gtest.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>

#include "runtime/include/lightloom_vulkan.h"
#include "tests/bench/bare_shaders.h"
#include "tests/bench/bench_asset.h"
#include "tests/bench/repeated_dispatch.h"
#include "tests/unit/runtime/test_runtime.h"

namespace lightloom {
namespace {

using bench::RepeatedPass;

constexpr int kRepeats = 9;
constexpr uint32_t kMoreDispatches = 4;

/// A device, a queue to submit to, and a runtime with the asset on it.
class Engine {
 public:
  Engine() {
    lightloom_vulkan_device_info info{};
    info.struct_size = sizeof info;
    EXPECT_EQ(lightloom_vulkan_make_device(&info, &device_), LIGHTLOOM_OK);
    EXPECT_TRUE(context_.vk.load_instance(device_.instance, device_.get_instance_proc_addr).ok());
    EXPECT_TRUE(context_.vk.load_device(device_.device, nullptr).ok());
    context_.device = device_.device;
    VkPhysicalDeviceProperties properties;
    context_.vk.GetPhysicalDeviceProperties(device_.physical_device, &properties);
    name_ = properties.deviceName;
    context_.limits = properties.limits;
    context_.vk.GetPhysicalDeviceMemoryProperties(device_.physical_device, &context_.memory);
    queue_ = *OwnQueue::create(&context_, device_.queue, device_.queue_family);

    lightloom_vulkan_create_info create{};
    create.struct_size = sizeof create;
    create.instance = device_.instance;
    create.physical_device = device_.physical_device;
    create.device = device_.device;
    create.get_instance_proc_addr = device_.get_instance_proc_addr;
    create.queue_family = device_.queue_family;
    create.frames_in_flight = 1;
    if (const char* const size = std::getenv("LIGHTLOOM_BENCH_WORKGROUP")) {
      create.workgroup_size = static_cast<uint32_t>(std::atoi(size));
    }
    bench::repeat_dispatches(device_, &create);
    EXPECT_EQ(lightloom_vulkan_create(&create, &runtime_), LIGHTLOOM_OK);

    lightloom_asset_info asset{};
    asset.struct_size = sizeof asset;
    asset.manifest = asset_.manifest.data();
    asset.manifest_bytes = asset_.manifest.size();
    asset.read_chunk = bench::BenchAsset::read_chunk;
    asset.read_user = &asset_;
    EXPECT_EQ(lightloom_load(runtime_, &asset), LIGHTLOOM_OK);
    light_ = testing::random_light(counts().surface_elements, 1);
    const auto set = [this](auto* setter, const std::vector<Vec3>& values) {
      EXPECT_EQ(setter(runtime_, &values[0].x, 0, values.size()), LIGHTLOOM_OK);
    };
    set(lightloom_set_direct, light_.direct);
    set(lightloom_set_albedo, light_.albedo);
    set(lightloom_set_emission, light_.emission);
    while (counts().pending_bytes > 0) frame();
  }
  ~Engine() {
    lightloom_destroy(runtime_);
    queue_ = nullptr;
    lightloom_vulkan_destroy_device(&device_);
  }

  const std::string& name() const { return name_; }
  lightloom_runtime* runtime() { return runtime_; }
  Context* context() { return &context_; }
  OwnQueue* queue() { return queue_.get(); }

  void frame() {
    const absl::Status status = queue_->run([this](VkCommandBuffer commands) -> absl::Status {
      EXPECT_EQ(lightloom_vulkan_record(runtime_, commands, nullptr), LIGHTLOOM_OK);
      return absl::OkStatus();
    });
    ASSERT_TRUE(status.ok()) << status;
  }
  /// Of the frame before the last: the last one's are taken by the next record.
  lightloom_stats stats() const {
    lightloom_stats s{};
    s.struct_size = sizeof s;
    EXPECT_EQ(lightloom_get_stats(runtime_, &s), LIGHTLOOM_OK);
    return s;
  }
  lightloom_counts counts() const {
    lightloom_counts c{};
    c.struct_size = sizeof c;
    EXPECT_EQ(lightloom_get_counts(runtime_, &c), LIGHTLOOM_OK);
    return c;
  }
  /// Milliseconds of all threads.
  template <class F>
  static double cpu_ms(F f) {
    const double start = bench::process_cpu_seconds();
    f();
    return 1e3 * (bench::process_cpu_seconds() - start);
  }

  /// Every radiance, so every probe and cell.
  void change_everything() {
    bright_ = !bright_;
    for (Vec3& e : light_.emission) e = bright_ ? e * 2.0f + Vec3{1, 1, 1} : (e - Vec3{1, 1, 1}) * 0.5f;
    EXPECT_EQ(lightloom_set_emission(runtime_, &light_.emission[0].x, 0, light_.emission.size()), LIGHTLOOM_OK);
    frame();
  }
  /// Every cell, but no probe: B is what it was.
  void recompute_cells() {
    EXPECT_EQ(lightloom_reset_feedback(runtime_), LIGHTLOOM_OK);
    frame();
  }
  SurfaceLight& light() { return light_; }

 private:
  bench::BenchAsset asset_ = bench::bench_asset();
  lightloom_vulkan_device device_{};
  std::string name_;
  Context context_;
  std::unique_ptr<OwnQueue> queue_;
  lightloom_runtime* runtime_ = nullptr;
  SurfaceLight light_;
  bool bright_ = false;
};

/// The fastest of its kind here and now.
std::unique_ptr<bench::BareShader> best_bare(Engine& engine, uint32_t columns, uint64_t bytes) {
  std::unique_ptr<bench::BareShader> best;
  double rate = 0;
  for (auto& shader : bench::bare_shaders(engine.context(), engine.queue(), columns, bytes)) {
    std::vector<double> runs;
    for (int i = 0; i < 5; ++i) runs.push_back(shader->gb_per_cpu_second());
    if (const double r = bench::spread(runs).most; r > rate) rate = r, best = std::move(shader);
  }
  std::fprintf(stderr, "best bare shader with %u columns over %.1f MB: %s\n", columns, 1e-6 * static_cast<double>(bytes),
               best->name().c_str());
  return best;
}

/// What `pass` costs, in turn with the bare shaders so that all see the same machine: the difference of frames that
/// dispatch it once and several times.
template <class Frame>
bench::PassSamples measure(RepeatedPass pass, uint32_t more, Frame frame,
                           const std::vector<std::unique_ptr<bench::BareShader>>& bare) {
  bench::PassSamples samples{};
  samples.path = "Vulkan";
  for (int i = 0; i < kRepeats; ++i) {
    if (!bare.empty()) {
      samples.bare_gb_per_s.push_back(bare[0]->gb_per_cpu_second());
      samples.bare_rgb_gb_per_s.push_back(bare[1]->gb_per_cpu_second());
    }
    bench::repeat_pass(RepeatedPass::kNone, 0);
    const double once = Engine::cpu_ms(frame);
    bench::repeat_pass(pass, more);
    samples.cpu_ms.push_back((Engine::cpu_ms(frame) - once) / more);
  }
  bench::repeat_pass(RepeatedPass::kNone, 0);
  return samples;
}

bench::PassSamples measure_cells(Engine& engine, RepeatedPass pass, uint32_t more, uint64_t bytes) {
  std::vector<std::unique_ptr<bench::BareShader>> bare;
  for (const uint32_t columns : {1u, 3u}) bare.push_back(best_bare(engine, columns, bytes));
  return measure(pass, more, [&] { engine.recompute_cells(); }, bare);
}

TEST(VulkanBench, PassesAgainstBareShaders) {
  Engine engine;
  engine.change_everything();
  engine.frame();
  lightloom_stats stats = engine.stats();
  const lightloom_counts counts = engine.counts();
  ASSERT_EQ(stats.updated_probes, counts.probes);
  ASSERT_EQ(stats.updated_cells, counts.active_cells);
  std::printf("%s; %u surface elements, %u probes, %u cells, %u clusters\n\n", engine.name().c_str(),
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
  bench::PassSamples relight =
      measure(RepeatedPass::kRelight, 1, [&] { engine.change_everything(); }, {});
  relight.pass = "relight";
  relight.bytes = relight_bytes;
  bench::print_pass(relight);
}

TEST(VulkanBench, FrameAgainstShareOfTheLightThatChanges) {
  Engine engine;
  lightloom_update_options options{};
  options.struct_size = sizeof options;
  options.epsilon = options.epsilon_floor = bench::kEpsilon;
  ASSERT_EQ(lightloom_set_update_options(engine.runtime(), &options), LIGHTLOOM_OK);
  const auto settle = [&] {
    for (int i = 0; i < 100 && engine.stats().skipped == 0; ++i) engine.frame();
  };
  settle();
  bench::print_frame_header();
  std::vector<Vec3>& direct = engine.light().direct;
  for (const double share : bench::kShares) {
    const size_t count = static_cast<size_t>(share * static_cast<double>(direct.size()));
    for (size_t s = 0; s < count; ++s) direct[s] = direct[s] * 1.5f + Vec3{1, 1, 1};
    const double set_ms = Engine::cpu_ms([&] {
      EXPECT_EQ(lightloom_set_direct(engine.runtime(), &direct[0].x, 0, count), LIGHTLOOM_OK);
    });
    const double frame_ms = Engine::cpu_ms([&] { engine.frame(); });
    engine.frame();
    const lightloom_stats s = engine.stats();
    bench::print_frame({"Vulkan", share, set_ms, frame_ms, s.changed_tiles, s.updated_probes, s.updated_cells});
    settle();
  }
}

}  // namespace
}  // namespace lightloom
