// Σ w·Y_j(d) over many directions. The SIMD of the transport: one file, eight lanes, with its scalar twin.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/sh.h"
#include "core/base/vec.h"

namespace lightloom {

/// Collects weighted directions and adds their spherical harmonics up, eight at a time. The result depends on the
/// directions and their order only.
class ShAccumulator {
 public:
  explicit ShAccumulator(int order);

  void add(Vec3 direction, float weight);
  /// out[j] += Σ w·Y_j(d) over what was added, then starts anew. REQUIRES: out.size() ≥ sh_count(order).
  void flush_into(std::span<float> out);

 private:
  void evaluate_lanes();

  int order_;
  int count_ = 0;  // filled lanes
  alignas(32) float x_[kShLanes] = {}, y_[kShLanes] = {}, z_[kShLanes] = {}, w_[kShLanes] = {};
  alignas(32) float basis_[kMaxShCount * kShLanes];
  alignas(32) float sum_[kMaxShCount * kShLanes];
};

/// The obvious version, for tests: the same sum up to rounding.
void accumulate_sh_scalar(int order, std::span<const Vec3> directions, std::span<const float> weights,
                          std::span<float> out);

}  // namespace lightloom
