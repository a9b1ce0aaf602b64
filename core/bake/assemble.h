// From finished cells, relight sets and surfaces to the manifest that names them.
#pragma once

#include <vector>

#include "core/bake/cell_record.h"
#include "core/bake/plan.h"

namespace lightloom {

/// The plan's indices of the probes that cells read, ascending. InvalidArgument: a cell reads one that is not planned.
absl::StatusOr<std::vector<uint32_t>> used_probes(const Plan& plan, const std::vector<CellRecord>& cells);

/// `cells` belong to plan.cells, `relight` to the plan's probes (those that no cell reads may be absent and are left
/// out), `surfaces` to the scene's objects. InvalidArgument says which of them does not fit the plan. The traces are left
/// to the caller.
absl::StatusOr<Manifest> assemble(const Plan& plan, const Scene& scene, const std::vector<CellRecord>& cells,
                                  const std::vector<ChunkRef>& relight, const std::vector<ChunkRef>& surfaces);

}  // namespace lightloom
