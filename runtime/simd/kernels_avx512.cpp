// Compiled with -mavx512f besides the flags of kernels_avx2.cpp; runs only where kernels.cpp has found them.
#include <immintrin.h>

#include "runtime/simd/kernels.h"

namespace lightloom::simd {
namespace {

using F = __m512;
constexpr uint32_t kLanes = 16;
// 24, 12 and 12 accumulators, of 32 registers.
constexpr uint32_t kProjectRows = 8;
constexpr uint32_t kRelightSplit = 1;
constexpr uint32_t kReceiveRuns = 4;

F zero() { return _mm512_setzero_ps(); }
F broadcast(float v) { return _mm512_set1_ps(v); }
F load(const float* p) { return _mm512_loadu_ps(p); }
void store(float* p, F v) { _mm512_storeu_ps(p, v); }
__m256i load_shorts(const uint16_t* p) { return _mm256_loadu_si256(reinterpret_cast<const __m256i*>(p)); }
F halfs(const uint16_t* p) { return _mm512_cvtph_ps(load_shorts(p)); }
F shorts(const uint16_t* p) { return _mm512_cvtepi32_ps(_mm512_cvtepu16_epi32(load_shorts(p))); }
F fma(F a, F b, F c) { return _mm512_fmadd_ps(a, b, c); }
F add(F a, F b) { return _mm512_add_ps(a, b); }
F mul(F a, F b) { return _mm512_mul_ps(a, b); }
float sum(F v) { return _mm512_reduce_add_ps(v); }
F max(F a, F b) { return _mm512_max_ps(a, b); }
F magnitude(F v) { return _mm512_abs_ps(v); }
bool differs(F a, F b, float epsilon, float floor) {
  const F limit = mul(broadcast(epsilon), max(magnitude(b), broadcast(floor)));
  return _mm512_cmp_ps_mask(magnitude(_mm512_sub_ps(a, b)), limit, _CMP_GT_OQ) != 0;
}

}  // namespace
}  // namespace lightloom::simd

#include "runtime/simd/kernels_lanes.h"

namespace lightloom::simd {

const Kernels kAvx512Kernels = {"avx512", radiosity, relight, project, receive};

}  // namespace lightloom::simd
