#include "core/transport/sh_accumulator.h"

#include <algorithm>
#include <array>

namespace lightloom {

ShAccumulator::ShAccumulator(int order) : order_(order) { std::fill(std::begin(sum_), std::end(sum_), 0.0f); }

void ShAccumulator::add(Vec3 d, float weight) {
  x_[count_] = d.x;
  y_[count_] = d.y;
  z_[count_] = d.z;
  w_[count_] = weight;
  if (++count_ == kShLanes) evaluate_lanes();
}

void ShAccumulator::evaluate_lanes() {
  sh_evaluate_lanes(order_, x_, y_, z_, basis_);
  const int n = sh_count(order_);
  for (int j = 0; j < n; ++j) {
    for (int lane = 0; lane < kShLanes; ++lane) sum_[j * kShLanes + lane] += w_[lane] * basis_[j * kShLanes + lane];
  }
  count_ = 0;
}

void ShAccumulator::flush_into(std::span<float> out) {
  if (count_ > 0) {
    for (int lane = count_; lane < kShLanes; ++lane) w_[lane] = 0;
    evaluate_lanes();
  }
  const int n = sh_count(order_);
  for (int j = 0; j < n; ++j) {
    const float* s = sum_ + j * kShLanes;
    out[static_cast<size_t>(j)] += ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
  }
  std::fill(sum_, sum_ + n * kShLanes, 0.0f);
}

void accumulate_sh_scalar(int order, std::span<const Vec3> directions, std::span<const float> weights,
                          std::span<float> out) {
  std::array<float, kMaxShCount> basis;
  for (size_t i = 0; i < directions.size(); ++i) {
    sh_evaluate(order, directions[i], basis);
    for (int j = 0; j < sh_count(order); ++j) out[static_cast<size_t>(j)] += weights[i] * basis[static_cast<size_t>(j)];
  }
}

}  // namespace lightloom
