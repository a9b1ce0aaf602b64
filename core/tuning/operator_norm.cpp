#include "core/tuning/operator_norm.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "core/bake/tasks.h"
#include "core/transport/gather.h"
#include "core/tuning/receiver_sample.h"

namespace lightloom {
namespace {

constexpr int kOrder = kMaxShOrder;  // of λ_x: the paper's
constexpr size_t kCount = kMaxShCount;
constexpr uint32_t kBatches = 4, kGatherRays = 1024, kProbeRays = 1024;  // each batch has so many
constexpr uint64_t kSeed = 0x09e2;                                       // of nothing else

constexpr float kGrazing = 1e-3f;  // a point of the receiver's own plane is not seen, on whatever side rounding puts it

using Functional = std::array<double, kCount>;  // of λ_x

/// What a ray of a probe meets.
struct Sight {
  enum Kind : uint8_t { kSurface, kSky, kDead } kind = kDead;
  Vec3 direction;
  Vec3 position;  ///< pushed off, for kSurface
};

/// An equal-area lattice, turned at random: its mean over turns has no error.
std::vector<Sight> look_around(const RayTracer& tracer, Vec3 probe, uint64_t seed) {
  Rng rng(seed);
  const float u = rng.next_float(), v = rng.next_float();
  const Vec3 pole = square_to_sphere(u, v);
  float s, c;
  sincos_2pi(rng.next_float(), &s, &c);
  const Scene& scene = tracer.scene();
  std::vector<Sight> out(kProbeRays);
  for (uint32_t i = 0; i < kProbeRays; ++i) {
    const Vec3 d = sphere_direction(i, kProbeRays);
    Sight& sight = out[i];
    sight.direction = normalize(to_world({c * d.x - s * d.y, s * d.x + c * d.y, d.z}, pole));
    const Hit hit = tracer.closest(probe, sight.direction);
    if (!hit) {
      sight.kind = Sight::kSky;
      continue;
    }
    if (is_dark_back(scene, hit)) continue;
    sight.kind = Sight::kSurface;
    sight.position = shading_point(scene.objects[hit.object], hit.triangle, hit.b1, hit.b2, hit.back).position;
  }
  return out;
}

/// ⟨cosθ, Y_l⟩ by the rays that α_x was gathered with, so that their noise is that of the difference; without those into the near
/// field, which says what it is asked.
Functional cosine(const RayTracer& tracer, const ReceiverSearch& surfaces, float near, const GatherPoint& point) {
  Functional out{};
  std::array<float, kCount> y;
  const Scene& scene = tracer.scene();
  Rng rng(point.seed);
  const Strata strata = strata_of(kGatherRays);
  for (uint32_t r = 0; r < kGatherRays; ++r) {
    const GatherRay ray = gather_ray(point, r, strata, &rng);
    const Hit hit = tracer.closest(ray.origin, ray.direction);
    if (hit && is_dark_back(scene, hit)) continue;
    if (hit && hit.t < near && surfaces.locate(hit) != Receivers::kNone) continue;
    sh_evaluate(kOrder, ray.direction, y);
    for (size_t l = 0; l < kCount; ++l) out[l] += static_cast<double>(kPi / kGatherRays * y[l]);
  }
  return out;
}

/// Whether x sees what the probe's ray met, and in which direction.
bool sees(const RayTracer& tracer, const ShadingPoint& x, const Sight& sight, Vec3* psi) {
  if (sight.kind == Sight::kDead) return false;
  *psi = sight.kind == Sight::kSky ? sight.direction : normalize(sight.position - x.position);
  if (dot(*psi, x.geometric) < kGrazing) return false;
  return sight.kind == Sight::kSky
             ? !tracer.occluded(x.position, sight.direction, std::numeric_limits<float>::infinity())
             : tracer.visible(sight.position, x.position);
}

/// Takes ⟨cosθ, P_x P* ·⟩ off, a probe's part of it: α_x,i · (P* ·)_i.
void subtract_round_trip(const RayTracer& tracer, const ShadingPoint& x, std::span<const Sight> sights,
                         std::span<const float> alpha, int order, Functional* m) {
  std::array<float, kCount> y;
  for (const Sight& sight : sights) {
    Vec3 psi;
    if (!sees(tracer, x, sight, &psi)) continue;
    sh_evaluate(order, sight.direction, y);
    float weight = 0;
    for (size_t j = 0; j < alpha.size(); ++j) weight += alpha[j] * y[j];
    weight *= 4 * kPi / static_cast<float>(sights.size());
    sh_evaluate(kOrder, psi, y);
    for (size_t l = 0; l < kCount; ++l) (*m)[l] -= static_cast<double>(weight * y[l]);
  }
}

/// ‖m‖² of the mean, without the variance that the batches show.
double squared_norm(const std::array<Functional, kBatches>& batches) {
  double out = 0;
  for (size_t l = 0; l < kCount; ++l) {
    double mean = 0, square = 0;
    for (const Functional& m : batches) mean += m[l] / kBatches, square += m[l] * m[l];
    const double variance = (square - kBatches * mean * mean) / (kBatches - 1);
    out += mean * mean - variance / kBatches;
  }
  return out;
}

}  // namespace

absl::StatusOr<std::vector<double>> operator_norms(const RayTracer& tracer, const Plan& plan,
                                                   std::span<const uint32_t> receivers, const Parallel& how) {
  const absl::Status cancelled = absl::CancelledError("cancelled while measuring operator norms");
  const Scene& scene = tracer.scene();
  const size_t J = static_cast<size_t>(sh_count(plan.params.order));
  const bool sl17 = plan.params.method == BakeMethod::kSl17;

  // What the probes in reach of these receivers see.
  std::vector<CellTask> tasks;
  std::map<uint32_t, std::vector<Sight>> sights;
  for (const uint32_t r : receivers) {
    tasks.push_back(make_cell_task(plan, scene, cell_of_one(r)));
    for (const uint32_t id : tasks.back().probe_ids) sights[id];
  }
  std::vector<uint32_t> ids;
  for (const auto& [id, unused] : sights) ids.push_back(id);
  Parallel quiet = how;
  quiet.progress = nullptr;
  const bool looked = parallel_for(ids.size(), quiet, [&](uint64_t i) {
    const Probe& probe = plan.placement.probes[ids[i]];
    std::vector<Sight>& all = sights.at(ids[i]);
    for (uint32_t b = 0; b < kBatches; ++b) {
      const std::vector<Sight> some = look_around(tracer, probe.position, hash_combine(kSeed + b, ids[i]));
      all.insert(all.end(), some.begin(), some.end());
    }
  });
  if (!looked) return cancelled;

  const std::vector<Vec3> positions = positions_of(plan.placement.probes);
  VisibilityCache cache(tracer, plan.layout, plan.receivers.grids, positions);
  const ReceiverSearch surfaces(tracer, plan.layout, plan.receivers);
  const float near = plan.params.near_field;
  std::vector<double> norms(receivers.size());
  const bool done = parallel_for(receivers.size(), how, [&](uint64_t i) {
    const CellTask& task = tasks[i];
    Gatherer gatherer(tracer, sl17 ? nullptr : &cache, &surfaces, {task.probes, task.probe_ids},
                      {plan.params.order, static_cast<int>(kGatherRays), !sl17, near});
    std::array<Functional, kBatches> batches;
    std::vector<float> row(task.probes.size() * J);
    for (uint32_t b = 0; b < kBatches; ++b) {
      GatherPoint point = task.receivers.front();
      point.seed = hash_combine(kSeed + b, point.seed);
      std::fill(row.begin(), row.end(), 0.0f);
      gatherer.add_row(point, row);
      batches[b] = cosine(tracer, surfaces, near, point);
      for (size_t p = 0; p < task.probes.size(); ++p) {
        const std::span<const float> alpha = std::span(row).subspan(p * J, J);
        if (std::all_of(alpha.begin(), alpha.end(), [](float a) { return a == 0; })) continue;
        subtract_round_trip(tracer, point.point,
                            std::span(sights.at(task.probe_ids[p])).subspan(b * kProbeRays, kProbeRays), alpha,
                            plan.params.order, &batches[b]);
      }
    }
    norms[i] = std::sqrt(std::max(0.0, squared_norm(batches)) / (2.0 / 3 * static_cast<double>(kPi)));
  });
  if (!done) return cancelled;
  return norms;
}

}  // namespace lightloom
