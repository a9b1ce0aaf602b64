// From geometry to the transport matrix of a bake cell: rays leave each receiver, and what they hit is read from the
// nearby probes that see it; what is very near is read from its own texel (ADR 0008).
//
// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse Radiance
// Probes", TOG 36(6), 2017, Eqs. 2, 4, 7. What may differ from the paper (ADR 0002) is in the options and in which
// probes a receiver is given.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "core/base/sampling.h"
#include "core/base/vec.h"
#include "core/receivers/receiver_search.h"
#include "core/receivers/surface_point.h"
#include "core/scene/ray_tracer.h"
#include "core/trace/trace_recorder.h"
#include "core/transport/sh_accumulator.h"
#include "core/transport/visibility_cache.h"

namespace lightloom {

struct GatherOptions {
  int order = 7;   ///< n, SH order of the probes
  int rays = 256;  ///< per receiver
  /// Weigh probes also by how finely they resolve what was hit: the solid angle of a unit of its area.
  bool weigh_by_resolution = true;
  /// Metres: what is nearer to where a ray starts is read from its own texel; 0: nothing is.
  float near_field = 0;
  bool rings = false;  ///< add_ring will be called
};

/// A texel in a receiver's near field: so many of its gather rays hit it, and read no probe.
struct NearTexel {
  uint32_t receiver = 0;  ///< the texel's, index into Receivers::all
  uint32_t rays = 0;
};

/// A receiver and the probes it may read, nearest first.
struct GatherPoint {
  ShadingPoint point;              ///< where it is: what weights are of
  std::vector<ShadingPoint> from;  ///< where rays start, spread over what the receiver stands for; at least one
  uint64_t seed = 0;
  std::vector<uint32_t> near;  ///< indices into the cell's probes: links, then fallbacks for what no link sees
  uint32_t links = 0;          ///< how many of `near` are blended
  float radius = 0;            ///< r of w(|x − p|/r), metres; 0: all links weigh alike
};

/// Gather ray r of a receiver: where it starts, and its unit direction. Rays are stratified over directions, and those of
/// one starting point are spread over them too (a Latin square). `rng` is seeded with the receiver's seed, and rays are
/// asked for in order.
struct GatherRay {
  Vec3 origin, direction;
};
GatherRay gather_ray(const GatherPoint& receiver, uint32_t r, Strata strata, Rng* rng);

/// Counts over many receivers.
struct GatherStats {
  uint64_t gather_rays = 0;
  uint64_t visibility_rays = 0;
  uint64_t unseen = 0;  ///< gather rays whose hit no reachable probe sees
  GatherStats& operator+=(const GatherStats& o);
};

/// A cell's probes.
struct GatherProbes {
  std::span<const Vec3> positions;
  std::span<const uint32_t> ids;  ///< what a VisibilityCache calls them
};

/// Works on one receiver after the other, with the memory of the last one.
class Gatherer {
 public:
  /// `cache` may be null: then a ray is traced for every hit and probe. `surfaces` may be null if there is no near field.
  /// `recorder` may be null: then nobody asks where the rays went. Keeps references to the arguments.
  Gatherer(const RayTracer& tracer, VisibilityCache* cache, const ReceiverSearch* surfaces, GatherProbes probes,
           const GatherOptions& options, TraceRecorder* recorder = nullptr);

  /// α_x, added to `row`: row[i·J + j] for probe i of the cell, J = sh_count(order). E = α·λ + Σ π·rays/options.rays·B over
  /// near().  REQUIRES: row.size() = probes·J.
  GatherStats add_row(const GatherPoint& receiver, std::span<float> row);
  /// The near field of the last receiver, each texel once, by its index.
  std::span<const NearTexel> near() const { return near_; }

  /// What a smaller near field would change, of the same rays: shoot() once, then add_ring() for one ring after the other. Rays
  /// that a near field of `to` metres has, and one of `from` metres has not, are added to `row` as if none had them, and
  /// near() is their texels. From near_field to infinity: the rays that no near field has.
  void shoot(const GatherPoint& receiver);
  GatherStats add_ring(float from, float to, std::span<float> row);

 private:
  /// What a gather ray found.
  struct Sample {
    enum Kind : uint8_t { kSurface, kSky, kDead } kind = kDead;
    uint32_t texel = Receivers::kNone;  ///< that a near field of more than `distance` reads
    float distance = std::numeric_limits<float>::infinity();
    VisibilityCache::Patch patch = VisibilityCache::kNoPatch;
    Vec3 position;  ///< of the hit, pushed off, for kSurface
    Vec3 normal;
    Vec3 direction;  ///< of the ray
    TraceRecorder::Place place = 0;
  };
  /// That a probe, by its place in `near`, sees the sample, and where.
  struct Sight {
    uint32_t sample = 0;
    float weight = 0;  ///< w_i·V_i, to be divided by their sum
    Vec3 psi;          ///< ψ_i(ω), unit
  };

  Sample trace(const GatherRay& ray);
  void find_near(float from, float to);
  GatherStats add_far(float from, float to, std::span<float> row);
  bool sees(uint32_t probe, const Sample& sample, Vec3* psi);

  const RayTracer& tracer_;
  VisibilityCache* cache_;
  const ReceiverSearch* surfaces_;
  TraceRecorder* recorder_;
  GatherProbes probes_;
  GatherOptions options_;
  const GatherPoint* receiver_ = nullptr;
  GatherStats stats_;
  ShAccumulator accumulator_;
  std::vector<Sample> samples_;
  std::vector<NearTexel> near_;
  std::vector<float> spatial_;              // w_i(x), per link
  std::vector<float> sum_;                  // Σ_k w_k·V_k, per sample
  std::vector<std::vector<Sight>> sights_;  // per place in `near`
};

}  // namespace lightloom
