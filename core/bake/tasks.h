// The units of work of a bake. Each is a pure function of the scene and a plain struct: same bytes wherever, whenever
// and however often it runs.
#pragma once

#include <cstdint>
#include <vector>

#include "core/asset/chunk.h"
#include "core/bake/cell_record.h"
#include "core/bake/plan.h"
#include "core/receivers/receiver_search.h"
#include "core/trace/trace.h"
#include "core/transport/gather.h"

namespace lightloom {

/// Of all that a bake cell's result is computed from but what its rays meet: that is what its trace is of. Same key, and
/// nothing changed along the trace: same bytes.
Digest cell_key(const Plan& plan, const Scene& scene, const PlannedCell& cell);
/// The same of a probe's relight set.
Digest relight_key(const Plan& plan, const Probe& probe);

/// Receivers of one bake cell, and the probes in their reach.
struct CellTask {
  BakeParams params;
  std::vector<ChunkObject> objects;
  std::vector<TexelRef> texels;        ///< per receiver
  std::vector<GatherPoint> receivers;  ///< `near` indexes `probes`
  std::vector<float> sigma;            ///< of each, for average_with_neighbours(), metres; empty: S = T
  std::vector<Vec3> probes;
  std::vector<uint32_t> probe_ids;  ///< the plan's index of each probe
  uint64_t seed = 0;                ///< of the cell's level and coordinates
  WorldGrid grid;
  Digest key;
};

struct CellResult {
  CellChunk chunk;
  std::vector<uint32_t> probe_ids;  ///< the cell's probe list: the plan's indices of probes that it reads
  std::vector<NearSurface> near;    ///< CellRecord::near
  GatherStats stats;
  double error = 0;
  Aabb bounds;
  Trace trace;
  double transport_seconds = 0, compress_seconds = 0;  ///< thread time; not part of the result's bytes
};

CellTask make_cell_task(const Plan& plan, const Scene& scene, const PlannedCell& cell);
/// `surfaces` are the plan's receivers. `cache` remembers what the plan's probes see, between cells; the result does not depend
/// on what is in it. Null (as SL17 is published): a ray is traced for every hit and probe. `cancel` may be null; the only error
/// is cancellation.
absl::StatusOr<CellResult> bake_cell(const RayTracer& tracer, const Plan& plan, const ReceiverSearch& surfaces,
                                     VisibilityCache* cache, const CellTask& task, const CancelFlag* cancel);

struct RelightResult {
  RelightChunk chunk;
  Trace trace;
};
/// What the probe sees along its relight rays, as texels of the plan's receivers.
RelightResult bake_relight(const RayTracer& tracer, const Plan& plan, const ReceiverSearch& receivers, Vec3 probe);

/// The receivers of one object.
SurfaceChunk make_surface(const Plan& plan, const Scene& scene, uint32_t object);

}  // namespace lightloom
