// Probes as Silvennoinen & Lehtinen 2017 place them (Sec. 4.1): the baseline that place_probes is measured against. Every
// decision looks at the whole level, so any edit may move every probe.
#pragma once

#include <span>

#include "core/probes/placement.h"

namespace lightloom {

struct Sl17Options {
  float spacing = 1;  ///< ρ_probes, metres
  int count = 0;      ///< of probes, and ρ follows; 0: as many as a regular grid of that spacing has over the level
  int overlap = 10;   ///< N_overlap, probes that cover a receiver on average
};

/// Candidates: empty voxels next to surfaces, connected to front-side receivers. Their densest regions are thinned. Back
/// sides that none of the probes within the support radius sees are dropped, as place_probes drops them. Errors: a
/// spacing that needs more voxels than fit; cancellation.
absl::StatusOr<PlacementResult> place_probes_sl17(const RayTracer& tracer, Receivers* receivers,
                                                  const Sl17Options& options, const Parallel& parallel);

/// The one radius r of all supports: that at which a receiver lies within r of `overlap` probes on average (of all, if
/// there are fewer), to a 65536th of the longest distance. 0 if there is no probe or no receiver.
float support_radius(std::span<const Probe> probes, const Receivers& receivers, int overlap);

}  // namespace lightloom
