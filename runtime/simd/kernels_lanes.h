// The kernels, written once for any lane count. A file that is compiled for one instruction set defines, in the unnamed
// namespace, and then includes this one:
//   F, kLanes                               a vector of kLanes floats
//   zero, broadcast, load, store            store and load need no alignment
//   halfs, shorts                           kLanes halfs, or uint16_t, as floats
//   fma(a, b, c) = a·b + c, add, mul, max, magnitude
//   sum                                     of the lanes, in a fixed order
//   differs(a, b, epsilon, floor)           whether |a − b| > epsilon · max(|b|, floor) in any lane
//   kProjectRows, kRelightSplit, kReceiveRuns   how much fits its registers
// scalar twin: kernels_scalar.cpp.
#pragma once

#include <xmmintrin.h>

#include "runtime/simd/kernels.h"

namespace lightloom::simd {
namespace {

constexpr float kInvPi = 0.31830988618379067f;
constexpr float kUniformScale = 3.14159265358979324f / 65535;  // unorm16 of π
constexpr float kInvShUniform = 0.28209479177387814f;          // √(4π) ÷ 4π
/// Rays whose radiance is gathered at a time: 12 KiB, which stays in the first-level cache.
constexpr uint32_t kRayBlock = 256;

bool radiosity(const RadiosityJob& job, float epsilon, float floor, float* radiosity, float greatest[3]) {
  F fresh[kTileFloats / kLanes];
  bool changed = false;
  for (uint32_t v = 0; v < kTileFloats / kLanes; ++v) {
    const uint32_t i = v * kLanes;
    const F arriving = add(load(job.direct + i), load(job.irradiance + i));
    fresh[v] = fma(mul(load(job.albedo + i), broadcast(kInvPi)), arriving, load(job.emission + i));
    changed |= differs(fresh[v], load(radiosity + i), epsilon, floor);
  }
  if (!changed) return false;
  // Three vectors hold whole colours.
  F top[3] = {zero(), zero(), zero()};
  for (uint32_t v = 0; v < kTileFloats / kLanes; ++v) {
    store(radiosity + v * kLanes, fresh[v]);
    top[v % 3] = max(top[v % 3], magnitude(fresh[v]));
  }
  float lanes[3 * kLanes];
  for (uint32_t v = 0; v < 3; ++v) store(lanes + v * kLanes, top[v]);
  greatest[0] = greatest[1] = greatest[2] = 0;
  for (uint32_t i = 0; i < 3 * kLanes; ++i) greatest[i % 3] = lanes[i] > greatest[i % 3] ? lanes[i] : greatest[i % 3];
  return true;
}

/// radiance[ray][probe][colour] of rays first … first + count. Floats behind the last are overwritten.
void gather(const RelightJob& job, uint32_t first, uint32_t count, float* radiance) {
  for (uint32_t r = 0; r < count; ++r) {
    for (uint32_t p = 0; p < kRelightProbes; ++p) {
      // Four floats at once; the fourth is replaced by the next probe's first.
      const __m128 rgb = job.elements[p] == nullptr
                             ? _mm_setzero_ps()
                             : _mm_loadu_ps(job.radiosity + size_t{3} * job.elements[p][first + r]);
      _mm_storeu_ps(radiance + r * kRelightColumns + 3 * p, rgb);
    }
  }
}

/// Adds Σ_r sh[r] · radiance[r] to kLambdaAlign λ of `Columns` columns.
template <uint32_t Columns>
void multiply(const float* sh, const float* radiance, uint32_t rays, float* lambda, uint32_t stride) {
  constexpr uint32_t kVectors = kLambdaAlign / kLanes;
  F total[kVectors][Columns];
  for (uint32_t v = 0; v < kVectors; ++v) {
    for (uint32_t c = 0; c < Columns; ++c) total[v][c] = zero();
  }
  for (uint32_t r = 0; r < rays; ++r) {
    for (uint32_t c = 0; c < Columns; ++c) {
      const F l = broadcast(radiance[r * kRelightColumns + c]);
      for (uint32_t v = 0; v < kVectors; ++v) {
        total[v][c] = fma(load(sh + r * kLambdaAlign + v * kLanes), l, total[v][c]);
      }
    }
  }
  for (uint32_t v = 0; v < kVectors; ++v) {
    for (uint32_t c = 0; c < Columns; ++c) {
      float* const to = lambda + c * stride + v * kLanes;
      store(to, add(load(to), total[v][c]));
    }
  }
}

/// A matrix product, Y (J × N) by L (N × 3·probes), in blocks that stay in registers and caches.
void relight(const RelightJob& job, float* lambda) {
  alignas(64) float radiance[kRayBlock * kRelightColumns + 4];
  const uint32_t stride = job.lambda_stride;
  for (uint32_t i = 0; i < kRelightColumns * stride; i += kLanes) store(lambda + i, zero());
  for (uint32_t first = 0; first < job.rays; first += kRayBlock) {
    const uint32_t count = job.rays - first < kRayBlock ? job.rays - first : kRayBlock;
    gather(job, first, count, radiance);
    for (uint32_t j = 0; j < stride; j += kLambdaAlign) {
      const float* const sh = job.sh + size_t{j} * job.rays + size_t{first} * kLambdaAlign;
      constexpr uint32_t kColumns = kRelightColumns / kRelightSplit;
      for (uint32_t c = 0; c < kRelightColumns; c += kColumns) {
        multiply<kColumns>(sh, radiance + c, count, lambda + c * stride + j, stride);
      }
    }
  }
  for (uint32_t i = 0; i < kRelightColumns * stride; i += kLanes) {
    store(lambda + i, mul(load(lambda + i), broadcast(job.scale)));
  }
}

/// c_k without correction, for rows k … k + Rows. The last vector of a probe may reach into the next probe's row,
/// where λ's padding is 0.
template <uint32_t Rows>
void project_rows(const ClusterView& cluster, const float* lambda, uint32_t lambda_stride, uint32_t k,
                  float* coefficients) {
  const size_t row = size_t{cluster.probe_count} * cluster.stride;
  const uint16_t* weight = cluster.projection + k * row;
  F total[Rows][3];
  for (uint32_t n = 0; n < Rows; ++n) total[n][0] = total[n][1] = total[n][2] = zero();
  for (uint32_t i = 0; i < cluster.probe_count; ++i, weight += cluster.stride) {
    const float* const l = lambda + size_t{3} * cluster.probes[i] * lambda_stride;
    for (uint32_t j = 0; j < cluster.stride; j += kLanes) {
      const F r = load(l + j), g = load(l + lambda_stride + j), b = load(l + 2 * lambda_stride + j);
      for (uint32_t n = 0; n < Rows; ++n) {
        const F w = halfs(weight + n * row + j);
        total[n][0] = fma(w, r, total[n][0]);
        total[n][1] = fma(w, g, total[n][1]);
        total[n][2] = fma(w, b, total[n][2]);
      }
    }
  }
  for (uint32_t n = 0; n < Rows; ++n) {
    for (uint32_t c = 0; c < 3; ++c) coefficients[4 * (k + n + 1) + c] = sum(total[n][c]);
  }
}

void project(const ClusterView& cluster, const float* lambda, uint32_t lambda_stride, float* coefficients) {
  for (uint32_t c = 0; c < 3; ++c) {
    float mean = 0;
    for (uint32_t i = 0; i < cluster.probe_count; ++i) {
      mean += lambda[(size_t{3} * cluster.probes[i] + c) * lambda_stride];
    }
    // Without probes there is no light.
    coefficients[c] = cluster.probe_count == 0 ? 0 : mean * (kInvShUniform / static_cast<float>(cluster.probe_count));
  }
  uint32_t k = 0;
  for (; k + kProjectRows <= cluster.rank; k += kProjectRows) {
    project_rows<kProjectRows>(cluster, lambda, lambda_stride, k, coefficients);
  }
  for (; k + 4 <= cluster.rank; k += 4) project_rows<4>(cluster, lambda, lambda_stride, k, coefficients);
  for (; k + 2 <= cluster.rank; k += 2) project_rows<2>(cluster, lambda, lambda_stride, k, coefficients);
  for (; k < cluster.rank; ++k) project_rows<1>(cluster, lambda, lambda_stride, k, coefficients);
  for (k = 0; k < cluster.rank; ++k) {
    for (uint32_t c = 0; c < 3; ++c) coefficients[4 * (k + 1) + c] -= cluster.correction[k] * coefficients[c];
  }
}

/// Receivers first … first + Runs·kReceiverAlign.
template <uint32_t Runs>
void receive_runs(const ClusterView& cluster, const float* coefficients, uint32_t first, float* irradiance) {
  constexpr uint32_t kVectors = Runs * kReceiverAlign / kLanes;
  F e[kVectors][3];
  for (uint32_t v = 0; v < kVectors; ++v) {
    const F u = mul(shorts(cluster.uniform + first + v * kLanes), broadcast(kUniformScale));
    for (uint32_t c = 0; c < 3; ++c) e[v][c] = mul(u, broadcast(coefficients[c]));
  }
  const size_t run = size_t{cluster.rank} * kReceiverAlign;
  const uint16_t* column = cluster.reconstruction + size_t{first} * cluster.rank;
  for (uint32_t k = 1; k <= cluster.rank; ++k, column += kReceiverAlign) {
    const float* const ck = coefficients + 4 * k;
    const F r = broadcast(ck[0]), g = broadcast(ck[1]), b = broadcast(ck[2]);
    for (uint32_t v = 0; v < kVectors; ++v) {
      const F w = halfs(column + v * kLanes / kReceiverAlign * run + v * kLanes % kReceiverAlign);
      e[v][0] = fma(w, r, e[v][0]);
      e[v][1] = fma(w, g, e[v][1]);
      e[v][2] = fma(w, b, e[v][2]);
    }
  }
  for (uint32_t v = 0; v < kVectors; ++v) {
    for (uint32_t c = 0; c < 3; ++c) store(irradiance + c * kReceiveBlock + v * kLanes, e[v][c]);
  }
}

void receive(const ClusterView& cluster, const float* coefficients, uint32_t first, uint32_t count, float* irradiance) {
  constexpr uint32_t kStep = kReceiveRuns * kReceiverAlign;
  uint32_t r = 0;
  for (; r + kStep <= count; r += kStep) {
    receive_runs<kReceiveRuns>(cluster, coefficients, first + r, irradiance + r);
  }
  for (; r < count; r += kReceiverAlign) receive_runs<1>(cluster, coefficients, first + r, irradiance + r);
}

}  // namespace
}  // namespace lightloom::simd
