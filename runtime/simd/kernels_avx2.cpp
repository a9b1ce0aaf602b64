// Compiled with -mavx2 -mfma -mf16c; runs only where kernels.cpp has found them.
#include <immintrin.h>

#include "runtime/simd/kernels.h"

namespace lightloom::simd {
namespace {

using F = __m256;
constexpr uint32_t kLanes = 8;
// 12 accumulators each, of 16 registers.
constexpr uint32_t kProjectRows = 4;
constexpr uint32_t kRelightSplit = 2;
constexpr uint32_t kReceiveRuns = 2;

F zero() { return _mm256_setzero_ps(); }
F broadcast(float v) { return _mm256_set1_ps(v); }
F load(const float* p) { return _mm256_loadu_ps(p); }
void store(float* p, F v) { _mm256_storeu_ps(p, v); }
__m128i load_shorts(const uint16_t* p) { return _mm_loadu_si128(reinterpret_cast<const __m128i*>(p)); }
F halfs(const uint16_t* p) { return _mm256_cvtph_ps(load_shorts(p)); }
F shorts(const uint16_t* p) { return _mm256_cvtepi32_ps(_mm256_cvtepu16_epi32(load_shorts(p))); }
F fma(F a, F b, F c) { return _mm256_fmadd_ps(a, b, c); }
F add(F a, F b) { return _mm256_add_ps(a, b); }
F mul(F a, F b) { return _mm256_mul_ps(a, b); }
float sum(F v) {
  __m128 s = _mm_add_ps(_mm256_castps256_ps128(v), _mm256_extractf128_ps(v, 1));
  s = _mm_add_ps(s, _mm_movehl_ps(s, s));
  return _mm_cvtss_f32(_mm_add_ss(s, _mm_movehdup_ps(s)));
}
F max(F a, F b) { return _mm256_max_ps(a, b); }
F magnitude(F v) { return _mm256_andnot_ps(broadcast(-0.0f), v); }
bool differs(F a, F b, float epsilon, float floor) {
  const F limit = mul(broadcast(epsilon), max(magnitude(b), broadcast(floor)));
  return _mm256_movemask_ps(_mm256_cmp_ps(magnitude(_mm256_sub_ps(a, b)), limit, _CMP_GT_OQ)) != 0;
}

}  // namespace
}  // namespace lightloom::simd

#include "runtime/simd/kernels_lanes.h"

namespace lightloom::simd {

const Kernels kAvx2Kernels = {"avx2", radiosity, relight, project, receive};

}  // namespace lightloom::simd
