// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse Radiance
// Probes", SIGGRAPH Asia 2017, Eq. 1; irradiance from radiance by Ramamoorthi & Hanrahan, "An Efficient Representation
// for Irradiance Environment Maps", SIGGRAPH 2001.
#include "core/baselines/sh_interpolation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>

#include "core/base/half.h"
#include "core/base/sh.h"
#include "core/baselines/lanes.h"
#include "core/probes/links.h"

namespace lightloom {
namespace {

/// A_l: coefficient of the clamped cosine, times √(4π/(2l+1)).
double cosine_coefficient(int l) {
  if (l == 1) return 2 * static_cast<double>(kPi) / 3;
  if (l % 2 == 1) return 0;
  // 2π · (−1)^(l/2−1) ÷ ((l+2)(l−1)) · l! ÷ (2^l · (l/2)!²); the last two factors are Π (i + l/2) ÷ 4i.
  const int half = l / 2;
  double binomial = 1;
  for (int i = 1; i <= half; ++i) binomial *= (i + half) / (4.0 * i);
  return (half % 2 == 1 ? 1 : -1) * 2 * static_cast<double>(kPi) / ((l + 2.0) * (l - 1.0)) * binomial;
}

/// N × stride: A_l · 4π/N · Y_j(ω_r), so that the rays' radiance becomes coefficients of the irradiance.
std::vector<float> projection(int order, uint32_t rays) {
  const size_t stride = static_cast<size_t>(sh_stride(order));
  std::vector<float> weights(rays * stride);
  std::array<float, kMaxShCount> basis;
  for (uint32_t r = 0; r < rays; ++r) {
    sh_evaluate(order, sphere_direction(r, rays), basis);
    for (int l = 0; l <= order; ++l) {
      const auto scale = static_cast<float>(cosine_coefficient(l) * 4 * static_cast<double>(kPi) / rays);
      for (int j = l * l; j < (l + 1) * (l + 1); ++j) {
        weights[r * stride + static_cast<size_t>(j)] = scale * basis[static_cast<size_t>(j)];
      }
    }
  }
  return weights;
}

struct Link {
  uint32_t probe;
  float weight;  ///< of a receiver's links: sum 1
};

class ShInterpolation final : public Baseline {
 public:
  ShInterpolation(RelightRays rays, const Plan& plan, int order)
      : Baseline(std::move(rays), plan.receivers.all.size(), 3 * static_cast<size_t>(sh_stride(order))),
        terms_(static_cast<size_t>(sh_count(order))),
        stride_(static_cast<size_t>(sh_stride(order))),
        projection_(projection(order, this->rays().count())) {
    const ProbeGrid grid(plan.placement.probes, plan.params.spacing);
    for (const Receiver& r : plan.receivers.all) {
      add_links(grid.nearest(r.point.position, plan.params.links + 1), static_cast<size_t>(plan.params.links));
      basis_.resize(basis_.size() + stride_);
      sh_evaluate(order, r.point.normal, std::span(basis_).last(stride_));
    }
  }

  uint64_t bytes() const override {
    return rays().bytes() + kept_bytes() + links_.size() * (sizeof(uint32_t) + sizeof(Half));
  }
  uint64_t bytes_per_frame() const override { return bytes() + kept_bytes(); }

 private:
  uint64_t kept_bytes() const { return probes() * 3 * terms_ * sizeof(Half); }

  void add_links(const std::vector<ProbeGrid::Near>& near, size_t links) {
    const size_t n = std::min(near.size(), links);
    const float radius = near.size() > links ? std::sqrt(near[links].distance2) : 0;
    const size_t first = links_.size();
    float sum = 0;
    for (size_t i = 0; i < n; ++i) {
      const float weight = radius > 0 ? spatial_weight(std::sqrt(near[i].distance2) / radius) : 1;
      if (!(weight > 0)) continue;
      links_.push_back({near[i].probe, weight});
      sum += weight;
    }
    // All as far as the support radius: the nearest stands for them.
    if (links_.size() == first && n > 0) links_.push_back({near[0].probe, sum = 1});
    for (size_t i = first; i < links_.size(); ++i) links_[i].weight /= sum;
    ends_.push_back(links_.size());
  }

  void relight(uint32_t probe, std::span<const Vec3> radiance, std::span<float> kept) const override {
    rays().project(probe, radiance, projection_, stride_, kept);
  }

  /// E = Σ_i w_i Σ_j A_l λ_ij Y_j(n).
  void receive(size_t first, std::span<const float> kept, std::span<Vec3> irradiance) const override {
    for (size_t i = 0; i < irradiance.size(); ++i) {
      const size_t r = first + i;
      Lanes sum[3] = {};
      for (size_t j = 0; j < stride_; j += kLanes) {
        Lanes blend[3] = {};
        for (size_t l = r > 0 ? ends_[r - 1] : 0; l < ends_[r]; ++l) {
          const float* coefficients = kept.data() + links_[l].probe * 3 * stride_ + j;
          for (size_t c = 0; c < 3; ++c) blend[c] += links_[l].weight * load_lanes(coefficients + c * stride_);
        }
        const Lanes basis = load_lanes(basis_.data() + r * stride_ + j);
        for (size_t c = 0; c < 3; ++c) sum[c] += blend[c] * basis;
      }
      Vec3 e;
      for (size_t lane = 0; lane < kLanes; ++lane) e += Vec3{sum[0][lane], sum[1][lane], sum[2][lane]};
      // Truncation rings below zero where light comes from one side only.
      irradiance[i] = {std::max(e.x, 0.0f), std::max(e.y, 0.0f), std::max(e.z, 0.0f)};
    }
  }

  size_t terms_, stride_;
  std::vector<float> projection_;
  std::vector<Link> links_;   ///< receiver after receiver
  std::vector<size_t> ends_;  ///< per receiver, of its links
  std::vector<float> basis_;  ///< receivers × stride: Y_j(n)
};

}  // namespace

absl::StatusOr<std::unique_ptr<Baseline>> make_sh_interpolation(const RayTracer& tracer, const Plan& plan, int order,
                                                                const BakeControl& control) {
  if (order < 0 || order > kMaxShOrder) {
    return absl::InvalidArgumentError("the order of SH interpolation must be 0 to " + std::to_string(kMaxShOrder));
  }
  if (plan.params.method != BakeMethod::kDefault) {
    return absl::InvalidArgumentError("SH interpolation needs a plan of the default method");
  }
  std::vector<Vec3> probes;
  for (const Probe& p : plan.placement.probes) probes.push_back(p.position);
  LL_ASSIGN_OR_RETURN(RelightRays rays, RelightRays::trace(tracer, plan, probes, control));
  return std::make_unique<ShInterpolation>(std::move(rays), plan, order);
}

}  // namespace lightloom
