#include "core/baselines/baseline.h"

#include <algorithm>

#include "core/base/check.h"
#include "core/base/sh.h"
#include "core/base/stopwatch.h"

namespace lightloom {

std::vector<Vec3> Baseline::light(const SurfaceInputs& inputs, Vec3 environment, int frames, const Parallel& how,
                                  FrameTimes* times) const {
  const size_t S = receivers_;
  LL_CHECK(inputs.direct.size() == S && inputs.albedo.size() == S && inputs.emission.size() == S && frames >= 0);
  constexpr size_t kBlock = 1024;  // receivers
  const auto blocks = [&](auto&& body) {
    LL_CHECK(parallel_for((S + kBlock - 1) / kBlock, how,
                          [&](uint64_t block) { body(block * kBlock, std::min(S, (block + 1) * kBlock)); }));
  };

  std::vector<Vec3> irradiance(S), radiance(S + 2);
  radiance[rays_.sky()] = environment;
  std::vector<float> kept(rays_.probes() * kept_);
  FrameTimes sum;
  for (int frame = 0; frame < frames; ++frame) {
    const Stopwatch radiosity_watch;
    blocks([&](size_t begin, size_t end) {
      for (size_t s = begin; s < end; ++s) {
        radiance[s] = inputs.albedo[s] * (inputs.direct[s] + irradiance[s]) * (1 / kPi) + inputs.emission[s];
      }
    });
    sum.radiosity += 1e3 * radiosity_watch.seconds();

    const Stopwatch relight_watch;
    LL_CHECK(parallel_for(rays_.probes(), how, [&](uint64_t p) {
      relight(static_cast<uint32_t>(p), radiance, std::span(kept).subspan(p * kept_, kept_));
    }));
    sum.relight += 1e3 * relight_watch.seconds();

    const Stopwatch receive_watch;
    blocks([&](size_t begin, size_t end) { receive(begin, kept, std::span(irradiance).subspan(begin, end - begin)); });
    sum.receive += 1e3 * receive_watch.seconds();
  }
  if (times != nullptr) {
    times->radiosity += sum.radiosity;
    times->relight += sum.relight;
    times->receive += sum.receive;
  }
  return irradiance;
}

}  // namespace lightloom
