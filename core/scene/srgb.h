// The sRGB curve, IEC 61966-2-1.
#pragma once

#include <cmath>

namespace lightloom {

/// From linear light in [0, 1].
inline float to_srgb(float linear) {
  return linear <= 0.0031308f ? 12.92f * linear : 1.055f * std::pow(linear, 1 / 2.4f) - 0.055f;
}
/// To linear light.
inline double from_srgb(double encoded) {
  return encoded <= 0.04045 ? encoded / 12.92 : std::pow((encoded + 0.055) / 1.055, 2.4);
}

}  // namespace lightloom
