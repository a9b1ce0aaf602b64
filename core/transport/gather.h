// From geometry to the transport matrix of a bake cell: rays leave each receiver, and what they hit is read from the
// nearby probes that see it.
//
// Silvennoinen & Lehtinen, "Real-time Global Illumination by Precomputed Local Reconstruction from Sparse Radiance
// Probes", TOG 36(6), 2017, Eqs. 2, 4, 7. Different from the paper (ADR 0002): links are the k nearest probes with the
// distance to the next one as support radius, and weights also follow how finely a probe resolves what was hit.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/vec.h"
#include "core/receivers/surface_point.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

struct GatherOptions {
  int order = 7;   ///< n, SH order of the probes
  int links = 6;   ///< k
  int rays = 256;  ///< per receiver, a square number
};

/// A receiver and the probes it may read, nearest first: the k links, the one that sets their support, then fallbacks.
struct GatherPoint {
  ShadingPoint point;
  uint64_t seed = 0;
  std::vector<uint32_t> near;  ///< indices into the cell's probes
};

/// Counts over many receivers.
struct GatherStats {
  uint64_t gather_rays = 0;
  uint64_t visibility_rays = 0;
  uint64_t unseen = 0;  ///< gather rays whose hit no reachable probe sees
  GatherStats& operator+=(const GatherStats& o);
};

/// α_x for one receiver, added to `row`: row[i·J + j] for probe i of the cell, J = sh_count(order). E = α·λ.
/// REQUIRES: row.size() = probes.size()·J, zero.
GatherStats gather_row(const RayTracer& tracer, const GatherPoint& receiver, std::span<const Vec3> probes,
                       const GatherOptions& options, std::span<float> row);

}  // namespace lightloom
