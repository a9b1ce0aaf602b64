// Eight floats at once.
#pragma once

#include <cstddef>
#include <cstring>

namespace lightloom {

inline constexpr size_t kLanes = 8;
using Lanes [[gnu::vector_size(kLanes * sizeof(float))]] = float;

inline Lanes load_lanes(const float* p) {
  Lanes v;
  std::memcpy(&v, p, sizeof v);
  return v;
}

}  // namespace lightloom
