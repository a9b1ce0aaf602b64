// Milliseconds and bytes of each pass of the SIMD runtime, beside a bare matrix–vector loop over as many bytes in the
// same run; and what a frame costs when only a part of the light changes.
#include <gtest/gtest.h>

#include <cstdio>
#include <vector>

#include "core/base/half.h"
#include "tests/bench/bare_loops.h"
#include "tests/bench/bench_asset.h"
#include "tests/bench/cpu_time.h"
#include "tests/unit/runtime/simd/simd_level.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom {
namespace {

constexpr int kRepeats = 9;

using bench::cpu_milliseconds;

/// A matrix of `bytes`, and what multiplying with it takes.
class BareMatrix {
 public:
  explicit BareMatrix(uint64_t bytes)
      : matrix_(std::max<uint64_t>(1, bytes / (2 * kColumns)) * kColumns, float_to_half(0.5f)),
        x_(kColumns, 1),
        y_(rows()) {}
  double gb_per_cpu_second(bench::BareLoop loop) {
    const double start = cpu_milliseconds();
    loop(matrix_.data(), rows(), kColumns, x_.data(), y_.data());
    return 1e-6 * static_cast<double>(2 * matrix_.size()) / (cpu_milliseconds() - start);
  }

 private:
  /// 16 probes of order 7.
  static constexpr size_t kColumns = 1024;
  size_t rows() const { return matrix_.size() / kColumns; }

  std::vector<uint16_t> matrix_;
  std::vector<float> x_, y_;
};

TEST(SimdBench, PassesAgainstBareLoops) {
  const AssetSource source = bench::bench_asset().open();
  const simd::KernelList& sets = simd::available_kernels();
  std::printf("%u surface elements, %zu probes of %d rays, %zu cells, %zu clusters; one thread\n\n",
              source.surface_elements(), source.manifest().probes.size(), source.manifest().params.relight_rays,
              source.manifest().cells.size(), source.manifest().clusters.size());
  bench::print_pass_header();
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
    const char* const name = sets.sets[k]->name;
    const bench::BareLoop bare = bench::bare_loop(name);
    ASSERT_NE(bare, nullptr);

    bench::PassSamples radiosity{name, "radiosity", uint64_t{60} * source.surface_elements(), {}, {}, {}};
    bench::PassSamples relight{name, "relight", stats.relight_bytes, {}, {}, {}};
    bench::PassSamples project{name, "project", stats.project_bytes, {}, {}, {}};
    bench::PassSamples receive{name, "receive", stats.receive_bytes, {}, {}, {}};
    for (int i = 0; i < kRepeats; ++i) {
      project.bare_gb_per_s.push_back(projection.gb_per_cpu_second(bare));
      receive.bare_gb_per_s.push_back(reconstruction.gb_per_cpu_second(bare));
      runtime->reset_feedback();  // everything has to be computed again
      const SimdStats before = stats;
      stats = runtime->update();
      radiosity.cpu_ms.push_back(stats.radiosity_ms - before.radiosity_ms);
      relight.cpu_ms.push_back(stats.relight_ms - before.relight_ms);
      project.cpu_ms.push_back(stats.project_ms - before.project_ms);
      receive.cpu_ms.push_back(stats.receive_ms - before.receive_ms);
    }
    for (const bench::PassSamples& pass : {radiosity, relight, project, receive}) bench::print_pass(pass);
  }
}

TEST(SimdBench, FrameAgainstShareOfTheLightThatChanges) {
  const AssetSource source = bench::bench_asset().open();
  SimdOptions options;
  options.threads = 1;
  options.milliseconds = cpu_milliseconds;
  const auto runtime = testing::simd_runtime(source, options);
  SurfaceLight light = testing::random_light(source.surface_elements(), 1);
  testing::set_light(light, runtime.get());
  SimdFrameOptions frame;
  frame.epsilon = frame.epsilon_floor = bench::kEpsilon;
  for (int i = 0; i < 100 && !runtime->update(frame).skipped;) ++i;
  bench::print_frame_header();
  for (const double share : bench::kShares) {
    const size_t count = static_cast<size_t>(share * source.surface_elements());
    for (size_t s = 0; s < count; ++s) light.direct[s] = light.direct[s] * 1.5f + Vec3{1, 1, 1};
    const double start = cpu_milliseconds();
    runtime->set_direct(0, testing::floats(light.direct).first(3 * count));
    const double set = cpu_milliseconds();
    const SimdStats stats = runtime->update(frame);
    const double end = cpu_milliseconds();
    bench::print_frame({runtime->kernels(), share, set - start, end - set, stats.changed_tiles, stats.updated_probes,
                        stats.updated_cells});
    for (int i = 0; i < 100 && !runtime->update(frame).skipped;) ++i;
  }
}

}  // namespace
}  // namespace lightloom
