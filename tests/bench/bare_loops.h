// The fastest that an fp16 matrix can be read and used, to compare passes with: y = M·x, nothing else.
#pragma once

#include <cstddef>
#include <cstdint>

namespace lightloom::bench {

/// y[row] = Σ_i matrix[row][i] · x[i]. REQUIRES: columns a multiple of 64.
using BareLoop = void (*)(const uint16_t* matrix, size_t rows, size_t columns, const float* x, float* y);

/// For the instruction set of simd::Kernels::name; null if there is none.
BareLoop bare_loop(const char* name);

}  // namespace lightloom::bench
