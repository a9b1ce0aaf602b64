// The one place that looks at the processor.
#include "runtime/simd/kernels.h"

#ifdef LIGHTLOOM_SIMD_X86
#include <cpuid.h>
#endif

namespace lightloom::simd {
namespace {

#ifdef LIGHTLOOM_SIMD_X86
bool has_f16c() {
  unsigned a = 0, b = 0, c = 0, d = 0;
  return __get_cpuid(1, &a, &b, &c, &d) != 0 && (c & bit_F16C) != 0;
}
#endif

KernelList detect() {
  KernelList list{};
  list.sets[list.count++] = &kScalarKernels;
#ifdef LIGHTLOOM_SIMD_X86
  // These also say whether the operating system keeps the registers; not every compiler knows "f16c" there.
  __builtin_cpu_init();
  if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma") && has_f16c()) {
    list.sets[list.count++] = &kAvx2Kernels;
    if (__builtin_cpu_supports("avx512f")) list.sets[list.count++] = &kAvx512Kernels;
  }
#endif
  return list;
}

}  // namespace

const KernelList& available_kernels() {
  static const KernelList list = detect();
  return list;
}

const Kernels& best_kernels() { return *available_kernels().sets[available_kernels().count - 1]; }

}  // namespace lightloom::simd
