// IEEE 754 binary16 as stored in assets. Conversions round to nearest even, saturate at ±65504, and keep subnormals.
#pragma once

#include <bit>
#include <cstdint>

namespace lightloom {

using Half = uint16_t;

inline Half float_to_half(float value) {
  const uint32_t bits = std::bit_cast<uint32_t>(value);
  const uint32_t sign = (bits >> 16) & 0x8000u;
  const uint32_t magnitude = bits & 0x7fffffffu;
  if (magnitude > 0x7f800000u) return static_cast<Half>(sign | 0x7e00u);   // NaN
  if (magnitude >= 0x477ff000u) return static_cast<Half>(sign | 0x7bffu);  // rounds past the largest half
  if (magnitude < 0x38800000u) {  // subnormal half: add a magic number so that the FPU does the rounding
    const float magic = std::bit_cast<float>(0x3f000000u);  // 0.5, whose ulp is the subnormal half's
    const float sum = std::bit_cast<float>(magnitude) + magic;
    return static_cast<Half>(sign | (std::bit_cast<uint32_t>(sum) - 0x3f000000u));
  }
  const uint32_t odd = (magnitude >> 13) & 1u;
  return static_cast<Half>(sign | ((magnitude - 0x38000000u + 0xfffu + odd) >> 13));
}

inline float half_to_float(Half h) {
  const uint32_t sign = static_cast<uint32_t>(h & 0x8000u) << 16;
  const uint32_t magnitude = h & 0x7fffu;
  if (magnitude < 0x400u) {  // zero and subnormals: value = magnitude · 2^-24
    const float v = static_cast<float>(magnitude) * 0x1p-24f;
    return std::bit_cast<float>(sign | std::bit_cast<uint32_t>(v));
  }
  if (magnitude >= 0x7c00u) return std::bit_cast<float>(sign | 0x7f800000u | (magnitude & 0x3ffu) << 13);
  return std::bit_cast<float>(sign | ((magnitude << 13) + 0x38000000u));
}

}  // namespace lightloom
