// The SIMD runtime's two passes over the asset's matrices, beside a copy of as many bytes.
#include <cstdint>
#include <cstring>
#include <memory>
#include <vector>

#include "tests/bench/bench_asset.h"
#include "tests/bench/ratios/ratio.h"
#include "tests/unit/runtime/simd/simd_level.h"
#include "tests/unit/runtime/synthetic_asset.h"

namespace lightloom::bench {
namespace {

/// A lit level, all of which is computed anew in every frame.
struct Level {
  Level() {
    SimdOptions options;
    options.threads = 1;
    options.milliseconds = cpu_milliseconds;
    runtime = testing::simd_runtime(source, options);
    testing::set_light(testing::random_light(source.surface_elements(), 1), runtime.get());
    stats = frame();
  }
  SimdStats frame() {
    runtime->reset_feedback();
    return runtime->update();
  }

  AssetSource source = bench_asset().open();
  std::unique_ptr<SimdRuntime> runtime;
  SimdStats stats;
};

Level& level() {
  static Level lit;
  return lit;
}

/// `ms`, `bytes`: of the pass.
void simd(benchmark::State& state, double SimdStats::*ms, uint64_t SimdStats::*bytes) {
  Level& lit = level();
  const std::vector<uint8_t> from(lit.stats.*bytes, 1);
  std::vector<uint8_t> to(from.size());
  Ratio ratio(&state, "copy of as many bytes");
  for ([[maybe_unused]] auto _ : state) {
    const SimdStats before = lit.stats;
    const double start = cpu_milliseconds();
    std::memcpy(to.data(), from.data(), from.size());
    benchmark::DoNotOptimize(to.data());
    const double copied = cpu_milliseconds();
    lit.stats = lit.frame();
    ratio.add(lit.stats.*ms - before.*ms, copied - start);
  }
}
BENCHMARK_CAPTURE(simd, project, &SimdStats::project_ms, &SimdStats::project_bytes)->UseManualTime()->Iterations(30);
BENCHMARK_CAPTURE(simd, receive, &SimdStats::receive_ms, &SimdStats::receive_bytes)->UseManualTime()->Iterations(30);

}  // namespace
}  // namespace lightloom::bench
