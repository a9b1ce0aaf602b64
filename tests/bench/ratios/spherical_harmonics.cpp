// Spherical harmonics of order 7, eight directions at a time, beside loops that only move or only add up as many bytes. All
// of it stays in the first-level cache, as in the transport.
#include <algorithm>
#include <array>
#include <memory>
#include <vector>

#include "core/base/rng.h"
#include "core/transport/sh_accumulator.h"
#include "tests/bench/ratios/ratio.h"

namespace lightloom::bench {
namespace {

constexpr int kOrder = 7;
constexpr size_t kLanes = kShLanes, kFloats = sh_count(kOrder) * kLanes;
constexpr uint32_t kDirections = 1 << 16;
using Block = std::array<float, kFloats>;

struct Weighted {
  std::array<float, kDirections> x, y, z, w;
};

const Weighted& directions() {
  static const auto all = [] {
    auto out = std::make_unique<Weighted>();
    Rng rng(1);
    for (uint32_t i = 0; i < kDirections; ++i) {
      const Vec3 d = sphere_direction(i, kDirections);
      out->x[i] = d.x, out->y[i] = d.y, out->z[i] = d.z, out->w[i] = rng.next_float();
    }
    return out;
  }();
  return *all;
}

void sh_evaluate(benchmark::State& state) {
  const Weighted& d = directions();
  Ratio ratio(&state, "copy of as many bytes");
  alignas(64) Block from{}, to{};
  for ([[maybe_unused]] auto _ : state) {
    ratio.turn(
        [&] {
          for (size_t i = 0; i < kDirections; i += kLanes) {
            benchmark::DoNotOptimize(from.data());
            std::copy(from.begin(), from.end(), to.begin());
            benchmark::DoNotOptimize(to.data());
            benchmark::ClobberMemory();
          }
        },
        [&] {
          for (size_t i = 0; i < kDirections; i += kLanes) {
            sh_evaluate_lanes(kOrder, &d.x[i], &d.y[i], &d.z[i], to.data());
            benchmark::ClobberMemory();
          }
        });
  }
}
BENCHMARK(sh_evaluate)->UseManualTime()->Iterations(100);

void sh_accumulate(benchmark::State& state) {
  const Weighted& d = directions();
  Ratio ratio(&state, "multiply-add over as many bytes");
  alignas(64) Block basis{}, sum{};
  ShAccumulator accumulator(kOrder);
  std::vector<float> out(static_cast<size_t>(sh_count(kOrder)));
  for ([[maybe_unused]] auto _ : state) {
    ratio.turn(
        [&] {
          for (size_t i = 0; i < kDirections; i += kLanes) {
            benchmark::DoNotOptimize(basis.data());
            for (size_t j = 0; j < kFloats; j += kLanes) {
              for (size_t lane = 0; lane < kLanes; ++lane) sum[j + lane] += d.w[i + lane] * basis[j + lane];
            }
            benchmark::DoNotOptimize(sum.data());
            benchmark::ClobberMemory();
          }
        },
        [&] {
          for (size_t i = 0; i < kDirections; ++i) accumulator.add({d.x[i], d.y[i], d.z[i]}, d.w[i]);
          accumulator.flush_into(out);
          benchmark::DoNotOptimize(out.data());
        });
  }
}
BENCHMARK(sh_accumulate)->UseManualTime()->Iterations(100);

}  // namespace
}  // namespace lightloom::bench
