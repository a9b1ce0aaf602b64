// Where the probes of dynamic diffuse global illumination lie: a regular grid, and each probe's way out of the solids
// around it.
#pragma once

#include <array>
#include <cstdint>

#include "core/base/status.h"
#include "core/base/vec.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// Probe (x, y, z) is number (x·counts[1] + y)·counts[2] + z and rests at origin + spacing · (x, y, z).
struct DdgiGrid {
  Vec3 origin, spacing;  ///< metres; the spacing may differ along the axes
  std::array<uint32_t, 3> counts{};

  uint32_t size() const { return counts[0] * counts[1] * counts[2]; }
  Vec3 rest(uint32_t probe) const;

  /// The eight probes around a point: corner c is probe base + corners()[c]. Its weight is the product over the axes of
  /// alpha where bit `axis` of c is set, 1 − alpha where not. Points outside the grid take its rim.
  struct Cage {
    uint32_t base = 0;
    Vec3 alpha;  ///< in [0, 1]
  };
  Cage cage(Vec3 p) const;
  /// A grid that is one probe wide along an axis has the same probe on either side.
  std::array<uint32_t, 8> corners() const;
};

/// Over the box. Within it, in the middle of cells of about `spacing`; or, to `enclose` it, at the corners of cells of
/// that size, the outer ones outside. An axis along which the box is shorter than half a cell is enclosed in any case.
/// Error: more than 2^20 probes.
absl::StatusOr<DdgiGrid> make_ddgi_grid(const Aabb& box, float spacing, bool enclose);

struct DdgiProbe {
  Vec3 position;
  bool open = false;  ///< not inside a solid
};
/// Relocation and classification (Majercik et al. 2021): a probe in a solid goes out through the nearest back face, one
/// nearer than `clearance` (share of the least spacing) to a surface backs off, none farther than 0.45 of the spacing
/// from its rest. `clearance` 0: it stays where it rests. It is in a solid if more than a quarter of its rays meet back
/// faces first, whatever the material says.
DdgiProbe place_ddgi_probe(const RayTracer& tracer, Vec3 rest, Vec3 spacing, float clearance);

}  // namespace lightloom
