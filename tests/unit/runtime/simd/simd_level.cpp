#include "tests/unit/runtime/simd/simd_level.h"

#include <algorithm>
#include <cmath>

#include "core/base/check.h"

namespace lightloom::testing {

std::unique_ptr<SimdRuntime> simd_runtime(const AssetSource& source, const SimdOptions& options) {
  auto runtime = std::make_unique<SimdRuntime>(source.index(), options);
  LL_CHECK(load_all(source, runtime.get()).ok());
  return runtime;
}

void set_light(const SurfaceLight& light, SimdRuntime* runtime) {
  runtime->set_direct(0, floats(light.direct));
  runtime->set_albedo(0, floats(light.albedo));
  runtime->set_emission(0, floats(light.emission));
  runtime->set_environment(light.environment);
}

std::vector<Vec3> irradiance(const SimdRuntime& runtime) {
  std::vector<Vec3> e(runtime.counts().surface_elements);
  runtime.read_irradiance({reinterpret_cast<float*>(e.data()), 3 * e.size()});
  return e;
}

std::vector<std::vector<Vec3>> decoded_frames(const AssetSource& source, const SurfaceLight& light, int frames) {
  const absl::StatusOr<DecoderAsset> decoder = load_decoder_asset(source);
  LL_CHECK(decoder.ok());
  std::vector<std::vector<Vec3>> all;
  std::vector<Vec3> e(source.surface_elements());
  for (int i = 0; i < frames; ++i) {
    e = decode_frame(*decoder, light, e).irradiance;
    all.push_back(e);
  }
  return all;
}

double largest_error(const std::vector<Vec3>& actual, const std::vector<Vec3>& expected) {
  LL_CHECK(actual.size() == expected.size());
  double largest = 0, sum = 0;
  for (size_t s = 0; s < expected.size(); ++s) {
    for (int c = 0; c < 3; ++c) {
      const double e = static_cast<double>(expected[s][c]);
      largest = std::max(largest, std::abs(static_cast<double>(actual[s][c]) - e));
      sum += std::abs(e);
    }
  }
  LL_CHECK(sum > 0);
  return largest * static_cast<double>(3 * expected.size()) / sum;
}

std::span<const float> floats(const std::vector<Vec3>& v) {
  return {reinterpret_cast<const float*>(v.data()), 3 * v.size()};
}

}  // namespace lightloom::testing
