// The kernels as plain loops: what the others are compared with, and what runs on any processor. The inner ones have
// fixed lengths, for compilers that know vectors.
#include <algorithm>
#include <bit>
#include <cmath>

#include "runtime/simd/kernels.h"

namespace lightloom::simd {
namespace {

constexpr float kInvPi = 0.31830988618379067f;
constexpr float kUniformScale = 3.14159265358979324f / 65535;  // unorm16 of π
constexpr float kInvShUniform = 0.28209479177387814f;          // √(4π) ÷ 4π

constexpr uint32_t kLanes = kLambdaAlign;

/// half_to_float without the branch for infinities, which do not occur in assets.
inline float finite_half(uint16_t h) {
  const uint32_t magnitude = h & 0x7fffu;
  const uint32_t subnormal = std::bit_cast<uint32_t>(static_cast<float>(static_cast<int32_t>(magnitude)) * 0x1p-24f);
  const uint32_t normal = (magnitude << 13) + 0x38000000u;
  return std::bit_cast<float>((magnitude < 0x400u ? subnormal : normal) | static_cast<uint32_t>(h & 0x8000u) << 16);
}

bool radiosity(const RadiosityJob& job, float epsilon, float floor, float* radiosity, float greatest[3]) {
  float fresh[kTileFloats];
  bool changed = false;
  for (uint32_t i = 0; i < kTileFloats; ++i) {
    fresh[i] = job.albedo[i] * kInvPi * (job.direct[i] + job.irradiance[i]) + job.emission[i];
    changed |= std::abs(fresh[i] - radiosity[i]) > epsilon * std::max(std::abs(radiosity[i]), floor);
  }
  if (!changed) return false;
  greatest[0] = greatest[1] = greatest[2] = 0;
  for (uint32_t i = 0; i < kTileFloats; ++i) {
    radiosity[i] = fresh[i];
    greatest[i % 3] = std::max(greatest[i % 3], std::abs(fresh[i]));
  }
  return true;
}

void relight(const RelightJob& job, float* lambda) {
  const uint32_t stride = job.lambda_stride;
  for (uint32_t i = 0; i < kRelightColumns * stride; ++i) lambda[i] = 0;
  for (uint32_t p = 0; p < kRelightProbes; ++p) {
    if (job.elements[p] == nullptr) continue;
    for (uint32_t j = 0; j < stride; j += kLanes) {
      float sum[3][kLanes] = {};
      const float* y = job.sh + size_t{j} * job.rays;
      for (uint32_t r = 0; r < job.rays; ++r, y += kLanes) {
        const float* const radiance = job.radiosity + size_t{3} * job.elements[p][r];
        for (uint32_t c = 0; c < 3; ++c) {
          for (uint32_t n = 0; n < kLanes; ++n) sum[c][n] += y[n] * radiance[c];
        }
      }
      for (uint32_t c = 0; c < 3; ++c) {
        for (uint32_t n = 0; n < kLanes; ++n) lambda[(3 * p + c) * stride + j + n] = job.scale * sum[c][n];
      }
    }
  }
}

void project(const ClusterView& cluster, const float* lambda, uint32_t lambda_stride, float* coefficients) {
  const auto plane = [&](uint32_t i, uint32_t c) {
    return lambda + (size_t{3} * cluster.probes[i] + c) * lambda_stride;
  };
  for (uint32_t c = 0; c < 3; ++c) {
    float mean = 0;
    for (uint32_t i = 0; i < cluster.probe_count; ++i) mean += plane(i, c)[0];
    // Without probes there is no light.
    coefficients[c] = cluster.probe_count == 0 ? 0 : mean * (kInvShUniform / static_cast<float>(cluster.probe_count));
  }
  const uint16_t* weight = cluster.projection;
  for (uint32_t k = 0; k < cluster.rank; ++k) {
    float sum[3][8] = {};  // the stride is a multiple of 8
    for (uint32_t i = 0; i < cluster.probe_count; ++i) {
      for (uint32_t j = 0; j < cluster.stride; j += 8, weight += 8) {
        float w[8];
        for (uint32_t n = 0; n < 8; ++n) w[n] = finite_half(weight[n]);
        for (uint32_t c = 0; c < 3; ++c) {
          for (uint32_t n = 0; n < 8; ++n) sum[c][n] += w[n] * plane(i, c)[j + n];
        }
      }
    }
    for (uint32_t c = 0; c < 3; ++c) {
      float total = 0;
      for (const float part : sum[c]) total += part;
      coefficients[4 * (k + 1) + c] = total - cluster.correction[k] * coefficients[c];
    }
  }
}

void receive(const ClusterView& cluster, const float* coefficients, uint32_t first, uint32_t count, float* irradiance) {
  for (uint32_t run = first; run < first + count; run += kReceiverAlign) {
    float e[3][kReceiverAlign];
    for (uint32_t n = 0; n < kReceiverAlign; ++n) {
      const float uniform = kUniformScale * static_cast<float>(cluster.uniform[run + n]);
      for (uint32_t c = 0; c < 3; ++c) e[c][n] = uniform * coefficients[c];
    }
    const uint16_t* column = cluster.reconstruction + size_t{run} * cluster.rank;
    for (uint32_t k = 1; k <= cluster.rank; ++k, column += kReceiverAlign) {
      float w[kReceiverAlign];
      for (uint32_t n = 0; n < kReceiverAlign; ++n) w[n] = finite_half(column[n]);
      for (uint32_t c = 0; c < 3; ++c) {
        for (uint32_t n = 0; n < kReceiverAlign; ++n) e[c][n] += w[n] * coefficients[4 * k + c];
      }
    }
    for (uint32_t c = 0; c < 3; ++c) {
      for (uint32_t n = 0; n < kReceiverAlign; ++n) irradiance[c * kReceiveBlock + run - first + n] = e[c][n];
    }
  }
}

}  // namespace

const Kernels kScalarKernels = {"scalar", radiosity, relight, project, receive};

}  // namespace lightloom::simd
