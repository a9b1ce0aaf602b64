#include "core/bake/assemble.h"

#include <algorithm>
#include <string>

#include "core/base/version.h"

namespace lightloom {
namespace {

absl::Status bad(const std::string& what) {
  return absl::InvalidArgumentError("cannot assemble the bake: " + what + "; run all tasks of one plan");
}

/// Records come from other machines: nothing in them may reach past the plan.
absl::Status check_fit(const Plan& plan, const Scene& scene, const std::vector<CellRecord>& cells,
                       const std::vector<ChunkRef>& relight, const std::vector<ChunkRef>& surfaces) {
  const size_t probes = plan.placement.probes.size();
  if (cells.size() != plan.cells.size() || relight.size() != probes || surfaces.size() != scene.objects.size()) {
    return bad("cells, probes or surfaces are not as many as planned");
  }
  for (size_t i = 0; i < cells.size(); ++i) {
    const CellRecord& c = cells[i];
    if (c.receivers() != plan.cells[i].receivers.size()) {
      return bad("cell " + std::to_string(i) + " has " + std::to_string(c.receivers()) + " receivers, planned were " +
                 std::to_string(plan.cells[i].receivers.size()));
    }
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<uint32_t>> used_probes(const Plan& plan, const std::vector<CellRecord>& cells) {
  std::vector<ProbeName> names;
  for (const CellRecord& c : cells) names.insert(names.end(), c.probes.begin(), c.probes.end());
  std::sort(names.begin(), names.end());
  names.erase(std::unique(names.begin(), names.end()), names.end());

  // Both ascend.
  std::vector<uint32_t> used;
  const auto& probes = plan.placement.probes;
  auto probe = probes.begin();
  for (const ProbeName& name : names) {
    probe =
        std::lower_bound(probe, probes.end(), name, [](const Probe& p, const ProbeName& n) { return p.name() < n; });
    if (probe == probes.end() || probe->name() != name) return bad("a cell reads a probe that is not planned");
    used.push_back(static_cast<uint32_t>(probe - probes.begin()));
  }
  return used;
}

absl::StatusOr<Manifest> assemble(const Plan& plan, const Scene& scene, const std::vector<CellRecord>& cells,
                                  const std::vector<ChunkRef>& relight, const std::vector<ChunkRef>& surfaces) {
  LL_RETURN_IF_ERROR(check_fit(plan, scene, cells, relight, surfaces));
  LL_ASSIGN_OR_RETURN(const std::vector<uint32_t> used, used_probes(plan, cells));
  for (const uint32_t p : used) {
    if (relight[p].size == 0) return bad("probe " + std::to_string(p) + " has no relight set");
  }
  Manifest m;
  m.method_version = std::string(kMethodVersion);
  m.scene_hash = scene_hash(scene);
  m.params = plan.params;
  m.layout_mode = static_cast<uint32_t>(plan.layout.mode);
  m.width = plan.layout.width;
  m.height = plan.layout.height;
  m.bounds = scene.bounds();
  for (size_t o = 0; o < scene.objects.size(); ++o) {
    const LightmapUv& uv = plan.layout.uv[o];
    if (uv.corners.empty()) continue;
    m.objects.push_back({scene.objects[o].id, scene.objects[o].name, uv.width, uv.height, plan.layout.placements[o].x,
                         plan.layout.placements[o].y, surfaces[o]});
  }
  for (const uint32_t i : used) {
    const Probe& p = plan.placement.probes[i];
    m.probes.push_back({p.position, p.cell, p.slot, relight[i]});
  }
  for (size_t i = 0; i < cells.size(); ++i) {
    const CellRecord& c = cells[i];
    CellEntry entry;
    entry.level = plan.cells[i].level;
    entry.cell = plan.cells[i].cell;
    entry.bounds = c.bounds;
    entry.receivers = static_cast<uint32_t>(c.receivers());
    entry.first_cluster = static_cast<uint32_t>(m.clusters.size());
    entry.clusters = static_cast<uint32_t>(c.clusters.size());
    entry.first_probe = static_cast<uint32_t>(m.cell_probes.size());
    entry.probes = static_cast<uint32_t>(c.probes.size());
    entry.chunk = c.chunk;
    entry.error = static_cast<float>(c.error);
    entry.stale = c.stale;
    entry.unseen =
        c.gather_rays > 0 ? static_cast<float>(static_cast<double>(c.unseen) / static_cast<double>(c.gather_rays)) : 0;
    m.clusters.insert(m.clusters.end(), c.clusters.begin(), c.clusters.end());
    for (const ProbeName& name : c.probes) {
      const auto at = std::lower_bound(used.begin(), used.end(), name, [&](uint32_t p, const ProbeName& n) {
        return plan.placement.probes[p].name() < n;
      });
      m.cell_probes.push_back(static_cast<uint32_t>(at - used.begin()));
    }
    m.cells.push_back(entry);
  }
  return m;
}

}  // namespace lightloom
