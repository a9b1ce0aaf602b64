// The SIMD runtime and the decoder side by side, for tests.
#pragma once

#include <memory>
#include <vector>

#include "runtime/decoder.h"
#include "runtime/simd/simd_runtime.h"

namespace lightloom::testing {

/// With everything resident. Aborts if the asset is bad.
std::unique_ptr<SimdRuntime> simd_runtime(const AssetSource& source, const SimdOptions& options = {});
void set_light(const SurfaceLight& light, SimdRuntime* runtime);
std::vector<Vec3> irradiance(const SimdRuntime& runtime);

/// E after each of `frames` frames from darkness, by the decoder.
std::vector<std::vector<Vec3>> decoded_frames(const AssetSource& source, const SurfaceLight& light, int frames);

/// Largest difference of a colour, relative to the mean of `expected`.
double largest_error(const std::vector<Vec3>& actual, const std::vector<Vec3>& expected);

std::span<const float> floats(const std::vector<Vec3>& v);

}  // namespace lightloom::testing
