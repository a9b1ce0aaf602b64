// The gather of a bake cell, as bake_cell() does it, with nothing before and after.
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "core/bake/tasks.h"

namespace lightloom::bench {

struct GatheredCell {
  GatherStats stats;
  uint64_t trace_bytes = 0;
};

/// `cache`, `surfaces`, `options`: as Gatherer. The rows are thrown away.
inline GatheredCell gather_cell(const RayTracer& tracer, VisibilityCache* cache, const ReceiverSearch& surfaces,
                                const CellTask& task, const GatherOptions& options) {
  TraceRecorder recorder(task.grid, task.probes.size());
  Gatherer gatherer(tracer, cache, &surfaces, {task.probes, task.probe_ids}, options, &recorder);
  std::vector<float> row(task.probes.size() * static_cast<size_t>(sh_count(options.order)));
  GatheredCell out;
  for (const GatherPoint& receiver : task.receivers) {
    std::fill(row.begin(), row.end(), 0.0f);
    out.stats += gatherer.add_row(receiver, row);
  }
  out.trace_bytes = recorder.finish(task.probes).runs.size();
  return out;
}

}  // namespace lightloom::bench
