// Milliseconds and bytes of each pass of the SIMD runtime, beside a bare matrix–vector loop over as many bytes in the
// same run; and what a frame costs when only a part of the light changes.
#include <gtest/gtest.h>
#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <vector>

#include "core/asset/asset.h"
#include "core/base/file.h"
#include "core/base/half.h"
#include "core/base/sh.h"
#include "tests/bench/bare_loops.h"
#include "tests/unit/runtime/simd/simd_level.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

constexpr int kRepeats = 9;

/// Of this thread: others on the machine must not count.
double cpu_milliseconds() {
  timespec t;
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e3 * static_cast<double>(t.tv_sec) + 1e-6 * static_cast<double>(t.tv_nsec);
}

AssetSource open_asset() {
  if (const char* const loom = std::getenv("LIGHTLOOM_BENCH_ASSET")) {
    const auto manifest = read_file(std::filesystem::path(loom) / "manifest");
    const ChunkStore store = chunk_store(loom);
    auto source = !manifest.ok() ? absl::StatusOr<AssetSource>(manifest.status())
                                 : AssetSource::open(*manifest, [store](const ChunkRef& ref, std::span<uint8_t> out) {
                                     const auto bytes = store.get(ref);
                                     if (bytes.ok()) std::copy(bytes->begin(), bytes->end(), out.begin());
                                     return bytes.status();
                                   });
    if (!source.ok()) {
      std::fprintf(stderr, "%s\n", source.status().ToString().c_str());
      std::exit(1);
    }
    return *std::move(source);
  }
  testing::RandomAssetOptions options;
  options.order = 7;
  options.relight_rays = 2048;
  options.objects = 40;
  options.side = 64;
  options.probes = 200;
  options.cells = 200;
  options.max_clusters = 8;
  options.max_cluster_probes = 20;
  static const testing::SyntheticAsset asset = testing::random_asset(options);
  return *asset.open();
}

double median(std::vector<double> v) {
  std::sort(v.begin(), v.end());
  return v[v.size() / 2];
}

/// A matrix of `bytes`, and what multiplying with it takes.
class BareMatrix {
 public:
  explicit BareMatrix(uint64_t bytes)
      : matrix_(std::max<uint64_t>(1, bytes / (2 * kColumns)) * kColumns, float_to_half(0.5f)),
        x_(kColumns, 1),
        y_(rows()) {}
  double milliseconds(bench::BareLoop loop) {
    const double start = cpu_milliseconds();
    loop(matrix_.data(), rows(), kColumns, x_.data(), y_.data());
    return cpu_milliseconds() - start;
  }
  uint64_t bytes() const { return 2 * matrix_.size(); }

 private:
  /// 16 probes of order 7.
  static constexpr size_t kColumns = 1024;
  size_t rows() const { return matrix_.size() / kColumns; }

  std::vector<uint16_t> matrix_;
  std::vector<float> x_, y_;
};

void print_pass(const char* pass, uint64_t bytes, const std::vector<double>& ms) {
  std::printf("  %-10s %8.3f ms  (%.3f … %.3f)  %7.2f MB  %6.2f GB/s", pass, median(ms),
              *std::min_element(ms.begin(), ms.end()), *std::max_element(ms.begin(), ms.end()),
              1e-6 * static_cast<double>(bytes), 1e-6 * static_cast<double>(bytes) / median(ms));
}

TEST(SimdBench, PassesAgainstBareLoops) {
  const AssetSource source = open_asset();
  const simd::KernelList& sets = simd::available_kernels();
  std::printf("%u surface elements, %zu probes of %d rays, %zu cells, %zu clusters; one thread, its CPU time\n",
              source.surface_elements(), source.manifest().probes.size(), source.manifest().params.relight_rays,
              source.manifest().cells.size(), source.manifest().clusters.size());
  const SurfaceLight light = testing::random_light(source.surface_elements(), 1);
  for (size_t k = 0; k < sets.count; ++k) {
    SimdOptions options;
    options.threads = 1;
    options.kernels = sets.sets[k];
    options.milliseconds = cpu_milliseconds;
    const auto runtime = testing::simd_runtime(source, options);
    testing::set_light(light, runtime.get());
    SimdStats stats = runtime->update();
    BareMatrix projection(stats.project_bytes), reconstruction(stats.receive_bytes);
    const bench::BareLoop bare = bench::bare_loop(sets.sets[k]->name);
    ASSERT_NE(bare, nullptr);

    std::vector<double> radiosity, relight, project, receive, bare_project, bare_receive;
    for (int i = 0; i < kRepeats; ++i) {
      bare_project.push_back(projection.milliseconds(bare));
      bare_receive.push_back(reconstruction.milliseconds(bare));
      runtime->reset_feedback();  // everything has to be computed again
      const SimdStats before = stats;
      stats = runtime->update();
      radiosity.push_back(stats.radiosity_ms - before.radiosity_ms);
      relight.push_back(stats.relight_ms - before.relight_ms);
      project.push_back(stats.project_ms - before.project_ms);
      receive.push_back(stats.receive_ms - before.receive_ms);
    }
    std::printf("%s\n", sets.sets[k]->name);
    print_pass("radiosity", uint64_t{60} * source.surface_elements(), radiosity);
    std::printf("\n");
    print_pass("relight", stats.relight_bytes, relight);
    const double multiplications = 3.0 * static_cast<double>(stats.relight_bytes) / 4 *
                                   static_cast<double>(sh_count(source.manifest().params.order));
    std::printf("  %.1f G multiply-adds/s\n", 1e-6 * multiplications / median(relight));
    print_pass("project", stats.project_bytes, project);
    std::printf("  bare %.2f, ratio %.2f\n", 1e-6 * static_cast<double>(projection.bytes()) / median(bare_project),
                median(bare_project) / median(project) * static_cast<double>(stats.project_bytes) /
                    static_cast<double>(projection.bytes()));
    print_pass("receive", stats.receive_bytes, receive);
    std::printf("  bare %.2f, ratio %.2f\n", 1e-6 * static_cast<double>(reconstruction.bytes()) / median(bare_receive),
                median(bare_receive) / median(receive) * static_cast<double>(stats.receive_bytes) /
                    static_cast<double>(reconstruction.bytes()));
  }
}

TEST(SimdBench, FrameAgainstShareOfTheLightThatChanges) {
  const AssetSource source = open_asset();
  SimdOptions options;
  options.threads = 1;
  options.milliseconds = cpu_milliseconds;
  const auto runtime = testing::simd_runtime(source, options);
  SurfaceLight light = testing::random_light(source.surface_elements(), 1);
  testing::set_light(light, runtime.get());
  SimdFrameOptions frame;
  frame.epsilon = 0.01f;
  frame.epsilon_floor = 0.01f;
  for (int i = 0; i < 100 && !runtime->update(frame).skipped;) ++i;
  std::printf("%s, epsilon %g: the frame after a change of the emission of the first elements\n", runtime->kernels(),
              static_cast<double>(frame.epsilon));
  for (const double share : {0.0, 0.0001, 0.001, 0.01, 0.1, 1.0}) {
    const size_t count = static_cast<size_t>(share * source.surface_elements());
    for (size_t s = 0; s < count; ++s) light.emission[s] = light.emission[s] * 1.5f + Vec3{1, 1, 1};
    const double start = cpu_milliseconds();
    runtime->set_emission(0, testing::floats(light.emission));
    const double set = cpu_milliseconds();
    const SimdStats stats = runtime->update(frame);
    const double end = cpu_milliseconds();
    std::printf("  %7.2f %%: set %7.3f ms, update %8.3f ms; tiles %u, probes %u, cells %u\n", 100 * share, set - start,
                end - set, stats.changed_tiles, stats.updated_probes, stats.updated_cells);
    for (int i = 0; i < 100 && !runtime->update(frame).skipped;) ++i;
  }
}

}  // namespace
}  // namespace lightloom
