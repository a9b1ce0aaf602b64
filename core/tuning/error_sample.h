// How far a plan's probes are from the truth, measured on a few receivers under a few lights before anything is baked.
//
// Truth and model look along the same gather rays, so that their difference is the model's alone: what probes blur, and texels.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "core/base/sh.h"
#include "core/transport/gather.h"
#include "core/tuning/sample_lights.h"

namespace lightloom {

/// Near fields that are tried, in units of the plan's, ascending.
inline constexpr std::array<float, 4> kReaches = {0, 0.5f, 1, 2};

/// With one of them, in units of rel_rmse; means over the lights.
struct ProbeErrors {
  std::array<double, kMaxShOrder + 1> bandlimit{};  ///< by the order of the probes: few, blurred measurements
  double unseen = 0;                                ///< of it: light from what no probe in reach sees
  double relight = 0;                               ///< of one relight ray: N rays have 1/√N of it
  std::array<double, 3> near_texels{};              ///< in a receiver's near field, by kNearRays
  static constexpr int kNearRays[] = {128, 256, 512};
  /// With 2ᵏ rays: in a line over k.
  double near_texels_by(int rays) const;
};
using ErrorsByReach = std::array<ProbeErrors, kReaches.size()>;

class ErrorSample {
 public:
  /// Keeps references to the tracer and the ground.
  static absl::StatusOr<std::unique_ptr<ErrorSample>> create(const RayTracer& tracer, const Plan& ground,
                                                             const Parallel& how);

  /// REQUIRES: a finished plan on the ground, by the default method. Error: cancellation.
  absl::StatusOr<ErrorsByReach> measure(const Plan& plan, const Parallel& how) const;

  const SampleLights& lights() const { return lights_; }
  /// E under each light from near texels, whose rays are a share of `rays`; added to `e`.
  void add_near_field(std::span<const NearTexel> near, uint32_t rays, std::span<double> e) const;
  const ReceiverSearch& surfaces() const { return search_; }
  /// λ of a probe by `rays` relight rays: lights × sh_count(order).
  std::vector<float> probe_radiance(Vec3 probe, uint32_t rays, int order) const;
  /// E² under each light, mean over the receivers measured.
  const std::vector<double>& energy() const { return energy_; }
  /// Their median. Lights that hardly light anything indirectly, by this, are to count less: a lamp in a box has a large error
  /// that nobody sees.
  double typical_energy() const;

 private:
  static constexpr size_t kOrders = kMaxShOrder + 1, kReachCount = kReaches.size();
  static constexpr uint32_t kBatchRays = 128, kBatches = 2;  ///< their spread tells the noise, which is not the model's
  /// Of one receiver, reach and light, squared: the error by order, without the noise of its own rays; what is unseen; that of
  /// relight rays.
  struct Sums {
    std::array<double, kOrders> error2{};
    double unseen2 = 0, relight2 = 0;
  };
  using NearTexels = std::array<std::array<uint32_t, kBatches>, kReachCount>;  ///< of one receiver, by batches so far
  class Look;

  ErrorSample(const RayTracer& tracer, const Plan& ground);
  ErrorsByReach mean_errors(const std::vector<Sums>& sums, const std::vector<NearTexels>& near_texels) const;
  /// What comes along a ray, by light; empty: nothing.
  std::span<const float> radiance(Vec3 origin, Vec3 direction) const;

  const RayTracer& tracer_;
  const Plan& ground_;
  ReceiverSearch search_;
  SampleLights lights_;
  std::vector<uint32_t> receivers_;  // of the ground: front sides, spread over the level
  std::vector<float> truth_;         // receivers × batches × lights
  std::vector<double> energy_;
};

}  // namespace lightloom
