#include "tests/bench/bare_loops.h"

#include <cstring>

#include "core/base/half.h"

#ifdef __x86_64__
#include <immintrin.h>
#endif

namespace lightloom::bench {
namespace {

void scalar(const uint16_t* matrix, size_t rows, size_t columns, const float* x, float* y) {
  for (size_t row = 0; row < rows; ++row, matrix += columns) {
    float sum = 0;
    for (size_t i = 0; i < columns; ++i) sum += half_to_float(matrix[i]) * x[i];
    y[row] = sum;
  }
}

#ifdef __x86_64__

__attribute__((target("avx2,fma,f16c"))) void avx2(const uint16_t* matrix, size_t rows, size_t columns, const float* x,
                                                   float* y) {
  for (size_t row = 0; row < rows; ++row, matrix += columns) {
    // Eight sums, so that none waits for itself.
    __m256 sum[8];
    for (__m256& s : sum) s = _mm256_setzero_ps();
    for (size_t i = 0; i < columns; i += 64) {
      for (size_t n = 0; n < 8; ++n) {
        const __m128i h = _mm_loadu_si128(reinterpret_cast<const __m128i*>(matrix + i + 8 * n));
        sum[n] = _mm256_fmadd_ps(_mm256_cvtph_ps(h), _mm256_loadu_ps(x + i + 8 * n), sum[n]);
      }
    }
    for (size_t n = 1; n < 8; ++n) sum[0] = _mm256_add_ps(sum[0], sum[n]);
    float lanes[8];
    _mm256_storeu_ps(lanes, sum[0]);
    y[row] = lanes[0] + lanes[1] + lanes[2] + lanes[3] + lanes[4] + lanes[5] + lanes[6] + lanes[7];
  }
}

__attribute__((target("avx512f"))) void avx512(const uint16_t* matrix, size_t rows, size_t columns, const float* x,
                                               float* y) {
  for (size_t row = 0; row < rows; ++row, matrix += columns) {
    __m512 sum[4];
    for (__m512& s : sum) s = _mm512_setzero_ps();
    for (size_t i = 0; i < columns; i += 64) {
      for (size_t n = 0; n < 4; ++n) {
        const __m256i h = _mm256_loadu_si256(reinterpret_cast<const __m256i*>(matrix + i + 16 * n));
        sum[n] = _mm512_fmadd_ps(_mm512_cvtph_ps(h), _mm512_loadu_ps(x + i + 16 * n), sum[n]);
      }
    }
    sum[0] = _mm512_add_ps(_mm512_add_ps(sum[0], sum[1]), _mm512_add_ps(sum[2], sum[3]));
    float lanes[16];
    _mm512_storeu_ps(lanes, sum[0]);
    y[row] = 0;
    for (const float lane : lanes) y[row] += lane;
  }
}

#endif

}  // namespace

BareLoop bare_loop(const char* name) {
#ifdef __x86_64__
  if (std::strcmp(name, "avx2") == 0) return avx2;
  if (std::strcmp(name, "avx512") == 0) return avx512;
#endif
  return std::strcmp(name, "scalar") == 0 ? scalar : nullptr;
}

}  // namespace lightloom::bench
