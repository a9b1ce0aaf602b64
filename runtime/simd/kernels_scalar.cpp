// The kernels as plain loops: what the others are compared with, and what runs on any processor.
#include <algorithm>
#include <cmath>

#include "core/base/half.h"
#include "runtime/simd/kernels.h"

namespace lightloom::simd {
namespace {

constexpr float kInvPi = 0.31830988618379067f;
constexpr float kUniformScale = 3.14159265358979324f / 65535;  // unorm16 of π
constexpr float kInvShUniform = 0.28209479177387814f;          // √(4π) ÷ 4π

bool radiosity(const RadiosityJob& job, float epsilon, float floor, float* radiosity) {
  float fresh[kTileFloats];
  bool changed = false;
  for (uint32_t i = 0; i < kTileFloats; ++i) {
    fresh[i] = job.albedo[i] * kInvPi * (job.direct[i] + job.irradiance[i]) + job.emission[i];
    changed |= std::abs(fresh[i] - radiosity[i]) > epsilon * std::max(std::abs(radiosity[i]), floor);
  }
  if (!changed) return false;
  for (uint32_t i = 0; i < kTileFloats; ++i) radiosity[i] = fresh[i];
  return true;
}

void relight(const RelightJob& job, float* lambda) {
  for (uint32_t p = 0; p < kRelightProbes; ++p) {
    for (uint32_t c = 0; c < 3; ++c) {
      float* const sum = lambda + (3 * p + c) * job.lambda_stride;
      for (uint32_t j = 0; j < job.lambda_stride; ++j) sum[j] = 0;
      if (job.elements[p] == nullptr) continue;
      for (uint32_t r = 0; r < job.rays; ++r) {
        const float radiance = job.radiosity[size_t{3} * job.elements[p][r] + c];
        for (uint32_t j = 0; j < job.lambda_stride; ++j) {
          const size_t block = j / kLambdaAlign;
          sum[j] += job.sh[(block * job.rays + r) * kLambdaAlign + j % kLambdaAlign] * radiance;
        }
      }
      for (uint32_t j = 0; j < job.lambda_stride; ++j) sum[j] *= job.scale;
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
    const uint16_t* weight = cluster.projection;
    for (uint32_t k = 0; k < cluster.rank; ++k) {
      float sum = 0;
      for (uint32_t i = 0; i < cluster.probe_count; ++i) {
        const float* const l = plane(i, c);
        for (uint32_t j = 0; j < cluster.stride; ++j) sum += half_to_float(*weight++) * l[j];
      }
      coefficients[4 * (k + 1) + c] = sum - cluster.correction[k] * coefficients[c];
    }
  }
}

void receive(const ClusterView& cluster, const float* coefficients, uint32_t first, uint32_t count, float* irradiance) {
  for (uint32_t c = 0; c < 3; ++c) {
    float* const e = irradiance + c * kReceiveBlock;
    for (uint32_t r = 0; r < count; ++r) {
      e[r] = kUniformScale * static_cast<float>(cluster.uniform[first + r]) * coefficients[c];
    }
    for (uint32_t k = 0; k < cluster.rank; ++k) {
      const uint16_t* const column = cluster.reconstruction + size_t{k} * cluster.padded + first;
      const float ck = coefficients[4 * (k + 1) + c];
      for (uint32_t r = 0; r < count; ++r) e[r] += half_to_float(column[r]) * ck;
    }
  }
}

}  // namespace

const Kernels kScalarKernels = {"scalar", radiosity, relight, project, receive};

}  // namespace lightloom::simd
