// A whole bake on this machine.
#pragma once

#include <filesystem>

#include "core/asset/manifest.h"
#include "core/bake/bake_traces.h"
#include "core/bake/plan.h"
#include "core/bake/reuse.h"
#include "core/bake/session.h"

namespace lightloom {

struct BakeReport {
  uint64_t receivers = 0, probes = 0, repairs = 0, clusters = 0, cells = 0;
  uint64_t rays_gather_reused = 0;  ///< of rays_gather
  uint64_t rays_gather = 0, rays_visibility = 0, rays_relight = 0, unseen = 0;
  double coefficients = 0;  ///< mean rank per receiver
  double seconds_total = 0, seconds_plan = 0;
  double seconds_receivers = 0, seconds_probes = 0;  ///< parts of the plan
  /// Thread time ÷ threads.
  double seconds_transport = 0, seconds_compress = 0, seconds_relight = 0;
  double seconds_write = 0;
  uint64_t clusters_reused = 0, cells_reused = 0, probes_reused = 0;  ///< taken over from an earlier bake
  uint64_t cells_stale = 0;                                           ///< of them: kept although they may have changed
  double stale = 0;                                                   ///< the largest CellEntry::stale
  uint64_t bytes_total = 0, bytes_projection = 0, bytes_reconstruction = 0, bytes_relight = 0;
};

/// What a finished asset says of its bake; nothing of times, nor of visibility rays.
BakeReport report_of(const Manifest& manifest);

/// What of the manifest's bake was taken over.
void count_reused(const Reuse& reuse, const Manifest& manifest, BakeReport* report);

/// What `session` spent; its threads were so many (0: one per hardware thread).
void add_times(const BakeSession& session, int threads, BakeReport* report);

/// Bakes into the folder `loom`. The old manifest, if any, stays in force until the new one replaces it whole. What holds
/// of `earlier`, whose chunks are there, is taken over: without a tolerance (see find_reuse) the bytes are as without it.
absl::StatusOr<BakeReport> bake(const RayTracer& tracer, const BakeParams& params, const std::filesystem::path& loom,
                                const BakeControl& control, const BakeTraces* earlier = nullptr, double tolerance = 0);

}  // namespace lightloom
