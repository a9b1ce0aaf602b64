#include "core/tuning/error_sample.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "core/bake/tasks.h"
#include "core/tuning/receiver_sample.h"

namespace lightloom {
namespace {

constexpr int kLights = 16;
constexpr uint64_t kSeed = 0x7a3e;                                // of nothing else
constexpr uint32_t kRelightRays = 1024, kOtherRelightRays = 987;  // two lattices, so that their difference is noise
constexpr size_t kLeastReceivers = 512, kMostReceivers = 4096, kShare = 14;

absl::Status cancelled() { return absl::CancelledError("cancelled while choosing parameters"); }

uint64_t batch_seed(uint64_t seed, uint32_t batch) { return hash_combine(seed, kSeed + batch); }

/// Mean over lights of √(error² ÷ energy). It is the power mean of exponent ¼: near the geometric one, by which renderers are
/// compared over many lights, but a zero is no harm. What is estimated without bias may come out below zero for a light, which
/// then does not count.
double relative(const std::vector<double>& error2, const std::vector<double>& energy, double typical) {
  double sum = 0, weights = 0;
  for (size_t l = 0; l < energy.size(); ++l) {
    if (!(energy[l] > 0) || error2[l] < 0) continue;
    const double weight = std::min(1.0, energy[l] / typical);
    sum += weight * std::sqrt(std::sqrt(std::sqrt(error2[l] / energy[l])));
    weights += weight;
  }
  const double mean = weights > 0 ? sum / weights : 0;  // no pow(): its last bit is the C library's
  return mean * mean * mean * mean;
}

constexpr size_t J = kMaxShCount;

/// λ of a plan's probes: lights × J each. `other`: by another number of relight rays, where it is known.
struct ProbeLight {
  std::vector<std::vector<float>> lambda, other;
};

}  // namespace

/// What the probes and near fields of a plan make of one receiver's E, from the hits of batches of rays.
class ErrorSample::Look {
 public:
  Look(const ErrorSample& sample, const ProbeLight& light, const CellTask& task)
      : sample_(sample),
        light_(light),
        task_(task),
        lights_(sample.lights().count()),
        row_(task.probes.size() * J),
        model_(kReachCount * lights_ * kOrders * kBatches),
        near_(lights_),
        unseen_(kReachCount),
        relight_(kReachCount * lights_) {}

  /// Batch `b`, which the gatherer has shot. From far to near: each smaller near field leaves a ring more to the probes, and
  /// the larger ones have it.
  void add(uint32_t b, std::span<const float> reach, Gatherer* gatherer) {
    std::fill(row_.begin(), row_.end(), 0.0f);
    uint64_t unseen_rays = 0;
    for (size_t k = kReachCount; k-- > 0;) {
      unseen_rays += gatherer->add_ring(reach[k], reach[k + 1], row_).unseen;
      unseen_[k] += static_cast<double>(unseen_rays) / kBatchRays / kBatches;
      std::fill(near_.begin(), near_.end(), 0.0);
      sample_.add_near_field(gatherer->near(), kBatchRays, near_);
      for (size_t larger = k + 1; larger < kReachCount; ++larger) {
        for (const NearTexel& n : gatherer->near()) texels_[larger].insert(n.receiver);
        for (size_t l = 0; l < lights_; ++l) {
          for (size_t n = 0; n < kOrders; ++n) model(larger, l, n, b) += near_[l];
        }
      }
      for (size_t p = 0; p < task_.probes.size(); ++p) add_probe(k, b, p);
    }
    for (size_t k = 0; k < kReachCount; ++k) near_texels_[k][b] = static_cast<uint32_t>(texels_[k].size());
  }

  const NearTexels& near_texels() const { return near_texels_; }

  Sums sums(size_t k, size_t l, const std::array<double, kBatches>& truth) {
    Sums out;
    double of_finest = 0;
    for (size_t n = 0; n < kOrders; ++n) {
      double mean = 0, square = 0, sum = 0;
      for (uint32_t b = 0; b < kBatches; ++b) {
        const double e = model(k, l, n, b), d = e - truth[b];
        sum += e / kBatches;
        mean += d / kBatches;
        square += d * d;
      }
      const double variance = (square - kBatches * mean * mean) / (kBatches - 1);
      out.error2[n] = mean * mean - variance / kBatches;
      of_finest = sum;
    }
    out.relight2 = relight_[k * lights_ + l];
    // What no probe sees is taken to be as bright as what is seen.
    const double unseen = unseen_[k] < 1 ? of_finest * unseen_[k] / (1 - unseen_[k]) : truth[0];
    out.unseen2 = unseen * unseen;
    return out;
  }

 private:
  double& model(size_t k, size_t l, size_t n, size_t b) {
    return model_[((k * lights_ + l) * kOrders + n) * kBatches + b];
  }

  /// What probe p adds by the row as it is.
  void add_probe(size_t k, uint32_t b, size_t p) {
    const float* alpha = &row_[p * J];
    if (std::all_of(alpha, alpha + J, [](float a) { return a == 0; })) return;
    const auto& second = light_.other[task_.probe_ids[p]];
    for (size_t l = 0; l < lights_; ++l) {
      const float* lambda = &light_.lambda[task_.probe_ids[p]][l * J];
      double band = 0, difference = 0;
      for (size_t n = 0; n < kOrders; ++n) {
        for (size_t j = n * n; j < (n + 1) * (n + 1); ++j) {
          band += static_cast<double>(alpha[j]) * static_cast<double>(lambda[j]);
        }
        model(k, l, n, b) += band;
      }
      if (second.empty()) continue;
      for (size_t j = 0; j < J; ++j) {
        difference +=
            static_cast<double>(alpha[j]) * (static_cast<double>(lambda[j]) - static_cast<double>(second[l * J + j]));
      }
      // Half of the squared difference is one lattice's variance; a quarter of the probes stand for all.
      relight_[k * lights_ + l] += 4 * 0.5 * difference * difference / kBatches;
    }
  }

  const ErrorSample& sample_;
  const ProbeLight& light_;
  const CellTask& task_;
  const size_t lights_;
  std::vector<float> row_;
  std::vector<double> model_;  // E: reaches × lights × orders × batches
  std::vector<double> near_, unseen_, relight_;
  std::array<std::set<uint32_t>, kReachCount> texels_;
  NearTexels near_texels_{};
};

double ProbeErrors::near_texels_by(int rays) const {
  const size_t i = rays < kNearRays[1] ? 0 : 1;  // of the pieces between 128 and 256, 256 and 512
  double doublings = 0;                          // from its begin; log2() would round as the C library likes
  for (int n = kNearRays[i]; n < rays; n *= 2) ++doublings;
  for (int n = kNearRays[i]; n > rays; n /= 2) --doublings;
  return std::max(0.0, near_texels[i] + doublings * (near_texels[i + 1] - near_texels[i]));
}

ErrorSample::ErrorSample(const RayTracer& tracer, const Plan& ground)
    : tracer_(tracer), ground_(ground), search_(tracer, ground.layout, ground.receivers) {}

absl::StatusOr<std::unique_ptr<ErrorSample>> ErrorSample::create(const RayTracer& tracer, const Plan& ground,
                                                                 const Parallel& how) {
  std::unique_ptr<ErrorSample> out(new ErrorSample(tracer, ground));
  LL_ASSIGN_OR_RETURN(out->lights_, SampleLights::create(tracer, ground, kLights, how));

  const std::vector<uint32_t> fronts = front_receivers(ground.receivers);
  out->receivers_ = stratified(fronts, std::clamp(fronts.size() / kShare, kLeastReceivers, kMostReceivers), kSeed);
  const size_t count = out->receivers_.size();
  const size_t lights = out->lights_.count();
  out->truth_.assign(count * kBatches * lights, 0);
  const Scene& scene = tracer.scene();
  const bool done = parallel_for(count, how, [&](uint64_t i) {
    // Rays start where a bake's do: the task of the receiver knows.
    const Plan& plan = ground;
    const Receiver& r = plan.receivers.all[out->receivers_[i]];
    GatherPoint point = make_cell_task(plan, scene, cell_of_one(out->receivers_[i])).receivers.front();
    std::vector<float> radiance(lights);
    for (uint32_t b = 0; b < kBatches; ++b) {
      float* e = &out->truth_[(i * kBatches + b) * lights];
      Rng rng(batch_seed(r.seed, b));
      const Strata strata = strata_of(kBatchRays);
      for (uint32_t k = 0; k < kBatchRays; ++k) {
        const GatherRay ray = gather_ray(point, k, strata, &rng);
        const Hit hit = tracer.closest(ray.origin, ray.direction);
        if (!hit || is_dark_back(scene, hit)) continue;
        out->lights_.radiance_at(tracer, hit, radiance);
        for (size_t l = 0; l < lights; ++l) e[l] += kPi / kBatchRays * radiance[l];
      }
    }
  });
  if (!done) return cancelled();
  out->energy_.assign(lights, 0);
  for (size_t i = 0; i < count; ++i) {
    for (size_t l = 0; l < lights; ++l) {
      double mean = 0;
      for (uint32_t b = 0; b < kBatches; ++b) {
        mean += static_cast<double>(out->truth_[(i * kBatches + b) * lights + l]) / kBatches;
      }
      out->energy_[l] += mean * mean / static_cast<double>(count);
    }
  }
  return out;
}

std::span<const float> ErrorSample::radiance(Vec3 origin, Vec3 direction) const {
  const Hit hit = tracer_.closest(origin, direction);
  if (!hit || is_dark_back(tracer_.scene(), hit)) return {};
  const uint32_t texel = search_.locate(hit);
  return texel == Receivers::kNone ? std::span<const float>() : lights_.radiance(texel);
}

void ErrorSample::add_near_field(std::span<const NearTexel> near, uint32_t rays, std::span<double> e) const {
  for (const NearTexel& n : near) {
    const auto radiance = lights_.radiance(n.receiver);
    for (size_t l = 0; l < e.size(); ++l) e[l] += static_cast<double>(kPi * radiance[l]) * n.rays / rays;
  }
}

std::vector<float> ErrorSample::probe_radiance(Vec3 probe, uint32_t rays, int order) const {
  const size_t J = static_cast<size_t>(sh_count(order)), lights = lights_.count();
  std::vector<float> y(J), out(lights * J);
  for (uint32_t i = 0; i < rays; ++i) {
    const Vec3 direction = sphere_direction(i, rays);
    const auto radiance = this->radiance(probe, direction);
    bool evaluated = false;
    for (size_t l = 0; l < radiance.size(); ++l) {
      if (!(radiance[l] > 0)) continue;
      if (!evaluated) sh_evaluate(order, direction, y);
      evaluated = true;
      float* lambda = &out[l * J];
      for (size_t j = 0; j < J; ++j) lambda[j] += radiance[l] * y[j];
    }
  }
  for (float& v : out) v *= 4 * kPi / static_cast<float>(rays);
  return out;
}

double ErrorSample::typical_energy() const {
  std::vector<double> sorted = energy_;
  const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
  std::nth_element(sorted.begin(), middle, sorted.end());
  return *middle;
}

absl::StatusOr<ErrorsByReach> ErrorSample::measure(const Plan& plan, const Parallel& how) const {
  static_assert(kBatchRays == ProbeErrors::kNearRays[0] && kBatches * kBatchRays == ProbeErrors::kNearRays[1]);
  Plan wide = plan;  // all orders at once: a lower one reads a part of the same coefficients
  wide.params.order = kMaxShOrder;
  wide.params.rays = kBatchRays;
  std::array<float, kReachCount + 1> reach{};
  for (size_t k = 0; k < kReachCount; ++k) reach[k] = kReaches[k] * plan.params.near_field;
  reach[kReachCount] = std::numeric_limits<float>::infinity();
  const size_t lights = lights_.count(), count = receivers_.size();

  const std::vector<Vec3> positions = positions_of(plan.placement.probes);
  VisibilityCache cache(tracer_, plan.layout, plan.receivers.grids, positions);
  Parallel quiet = how;
  quiet.progress = nullptr;
  ProbeLight light{std::vector<std::vector<float>>(positions.size()),
                   std::vector<std::vector<float>>(positions.size())};
  const bool lit = parallel_for(positions.size(), quiet, [&](uint64_t p) {
    light.lambda[p] = probe_radiance(positions[p], kRelightRays, kMaxShOrder);
    // Every fourth probe pays for the second lattice: enough to know the noise.
    if (p % 4 == 0) light.other[p] = probe_radiance(positions[p], kOtherRelightRays, kMaxShOrder);
  });
  if (!lit) return cancelled();

  std::vector<Sums> sums(count * kReachCount * lights);
  std::vector<NearTexels> near_texels(count);
  const bool done = parallel_for(count, how, [&](uint64_t i) {
    const Receiver& r = ground_.receivers.all[receivers_[i]];
    const uint32_t own = plan.receivers.find(r.object, r.key);
    if (own == Receivers::kNone) return;  // a back side that this plan drops
    const CellTask task = make_cell_task(wide, tracer_.scene(), cell_of_one(own));
    Gatherer gatherer(tracer_, &cache, &search_, {task.probes, task.probe_ids},
                      {kMaxShOrder, kBatchRays, true, reach[kReachCount - 1], true});
    Look look(*this, light, task);
    for (uint32_t b = 0; b < kBatches; ++b) {
      GatherPoint point = task.receivers.front();
      point.seed = batch_seed(r.seed, b);
      gatherer.shoot(point);
      look.add(b, reach, &gatherer);
    }
    near_texels[i] = look.near_texels();
    for (size_t k = 0; k < kReachCount; ++k) {
      for (size_t l = 0; l < lights; ++l) {
        std::array<double, kBatches> truth;
        for (uint32_t b = 0; b < kBatches; ++b) {
          truth[b] = static_cast<double>(truth_[(i * kBatches + b) * lights + l]);
        }
        sums[(i * kReachCount + k) * lights + l] = look.sums(k, l, truth);
      }
    }
  });
  if (!done) return cancelled();
  return mean_errors(sums, near_texels);
}

ErrorsByReach ErrorSample::mean_errors(const std::vector<Sums>& sums,
                                       const std::vector<NearTexels>& near_texels) const {
  const size_t lights = lights_.count(), count = receivers_.size();
  ErrorsByReach all;
  for (size_t k = 0; k < kReachCount; ++k) {
    ProbeErrors& out = all[k];
    const auto total = [&](auto&& of) {
      std::vector<double> by_light(lights);
      for (size_t i = 0; i < count; ++i) {
        for (size_t l = 0; l < lights; ++l)
          by_light[l] += of(sums[(i * kReachCount + k) * lights + l]) / static_cast<double>(count);
      }
      return relative(by_light, energy_, typical_energy());
    };
    const double relight = total([](const Sums& s) { return s.relight2; });
    for (size_t n = 0; n < kOrders; ++n) {
      const double error = total([n](const Sums& s) { return s.error2[n]; });
      out.bandlimit[n] = std::sqrt(std::max(0.0, error * error - relight * relight));
    }
    out.unseen = total([](const Sums& s) { return s.unseen2; });
    out.relight = std::sqrt(static_cast<double>(kRelightRays)) * relight;
    for (size_t i = 0; i < count; ++i) {
      for (size_t n = 0; n < kBatches; ++n) {
        out.near_texels[n] += static_cast<double>(near_texels[i][k][n]) / static_cast<double>(count);
      }
    }
    out.near_texels[2] = 2 * out.near_texels[1] - out.near_texels[0];  // each doubling finds about as many
  }
  return all;
}

}  // namespace lightloom
