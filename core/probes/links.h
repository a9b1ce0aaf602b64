// Which probes a receiver reads.
#pragma once

#include <absl/functional/function_ref.h>

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "core/base/vec.h"
#include "core/probes/placement.h"

namespace lightloom {

/// Nearest-probe queries through the world grid. Keeps a reference to the probes.
class ProbeGrid {
 public:
  /// REQUIRES: probes sorted by name.
  ProbeGrid(std::span<const Probe> probes, float spacing);

  struct Near {
    float distance2;  ///< m²
    uint32_t probe;
    bool operator<(const Near& o) const { return distance2 != o.distance2 ? distance2 < o.distance2 : probe < o.probe; }
  };
  /// The `count` probes nearest to p (fewer if there are not as many within kReach cells), nearest first, ties by index.
  /// REQUIRES: count > 0; p within 2^30 cells of the origin.
  std::vector<Near> nearest(Vec3 p, int count) const;

  /// All probes within `radius` of p, nearest first, ties by index.
  std::vector<Near> within(Vec3 p, float radius) const;

  /// Probes farther than this many cells are not looked for by nearest(): what lies beyond cannot change a receiver's links.
  static constexpr int kReach = 8;

 private:
  std::span<const Probe> probes_;
  float spacing_;
};

/// Drops the back sides that none of the probes near them sees: they lie in cavities that no light of the level's open
/// space enters and no camera looks into. Error: cancellation.
absl::Status drop_unseen_backs(const RayTracer& tracer, std::span<const Probe> probes,
                               absl::FunctionRef<std::vector<ProbeGrid::Near>(Vec3)> near, Receivers* receivers,
                               const Parallel& parallel);

/// The cell of side `spacing` of the world grid that p lies in.
std::array<int32_t, 3> probe_cell(Vec3 p, float spacing);

/// w(t) = 2t³ − 3t² + 1 on [0,1], else 0 (SL17 Eq. 10).
inline float spatial_weight(float t) { return t < 1 ? (2 * t - 3) * t * t + 1 : 0; }

}  // namespace lightloom
