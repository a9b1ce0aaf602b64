// A function of direction as a square of N × N texels in the octahedral map, with a border of one texel that makes
// bilinear lookups continuous over the map's edges (Majercik et al. 2019; Cigolle et al. 2014).
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <span>

#include "core/base/octahedral.h"
#include "core/base/vec.h"

namespace lightloom {

template <size_t N>
struct OctahedralMap {
  static constexpr size_t kSide = N + 2;
  static constexpr size_t kTexels = kSide * kSide;

  /// Of texel (x, y) of the square within the border.
  static constexpr size_t index(size_t x, size_t y) { return (y + 1) * kSide + x + 1; }
  /// Unit, at the texel's centre.
  static Vec3 direction(size_t x, size_t y) {
    const auto along = [](size_t i) { return (2 * static_cast<float>(i) + 1) / static_cast<float>(N) - 1; };
    return normalize(from_octahedral({along(x), along(y)}));
  }

  /// Beyond an edge the map goes on from the mirrored place of the same edge; beyond a corner, from the one opposite.
  template <class T>
  static void fill_border(std::span<T> map) {
    constexpr size_t kEnd = N + 1;
    for (size_t i = 1; i <= N; ++i) {
      map[i] = map[kSide + kEnd - i];
      map[kEnd * kSide + i] = map[N * kSide + kEnd - i];
      map[i * kSide] = map[(kEnd - i) * kSide + 1];
      map[i * kSide + kEnd] = map[(kEnd - i) * kSide + N];
    }
    map[0] = map[N * kSide + N];
    map[kEnd] = map[N * kSide + 1];
    map[kEnd * kSide] = map[kSide + N];
    map[kEnd * kSide + kEnd] = map[kSide + 1];
  }

  /// Four texels around a direction: first, first + 1, first + kSide, first + kSide + 1; weights sum to 1.
  struct Tap {
    size_t first;
    std::array<float, 4> weight;

    /// Of what `texel` gives for an index into the map.
    auto blend(auto&& texel) const {
      return texel(first) * weight[0] + texel(first + 1) * weight[1] + texel(first + kSide) * weight[2] +
             texel(first + kSide + 1) * weight[3];
    }
  };
  /// `d`: of any length but 0.
  static Tap tap(Vec3 d) {
    const Vec2 p = octahedral(d);
    const float x = (p.x + 1) * (0.5f * static_cast<float>(N)) + 0.5f;
    const float y = (p.y + 1) * (0.5f * static_cast<float>(N)) + 0.5f;
    const size_t x0 = std::min(static_cast<size_t>(x), N), y0 = std::min(static_cast<size_t>(y), N);
    const float u = x - static_cast<float>(x0), v = y - static_cast<float>(y0);
    return {y0 * kSide + x0, {(1 - u) * (1 - v), u * (1 - v), (1 - u) * v, u * v}};
  }
};

}  // namespace lightloom
