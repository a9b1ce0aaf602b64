#include <algorithm>

#include "core/bake/bake.h"
#include "core/base/check.h"
#include "core/base/version.h"

namespace lightloom {

std::vector<uint32_t> used_probes(const std::vector<CellResult>& cells) {
  std::vector<uint32_t> used;
  for (const CellResult& c : cells) used.insert(used.end(), c.probe_ids.begin(), c.probe_ids.end());
  std::sort(used.begin(), used.end());
  used.erase(std::unique(used.begin(), used.end()), used.end());
  return used;
}

Manifest assemble(const Plan& plan, const Scene& scene, const std::vector<CellResult>& cells,
                  const std::vector<ChunkRef>& cell_refs, const std::vector<ChunkRef>& relight,
                  const std::vector<ChunkRef>& surfaces) {
  const std::vector<uint32_t> used = used_probes(cells);
  LL_CHECK(cells.size() == plan.cells.size() && cell_refs.size() == cells.size() && relight.size() == used.size() &&
           surfaces.size() == scene.objects.size());
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
  for (size_t i = 0; i < used.size(); ++i) {
    const Probe& p = plan.placement.probes[used[i]];
    m.probes.push_back({p.position, p.cell, p.slot, relight[i]});
  }
  for (size_t i = 0; i < cells.size(); ++i) {
    const CellResult& c = cells[i];
    CellEntry entry;
    entry.level = plan.cells[i].level;
    entry.cell = plan.cells[i].cell;
    entry.bounds = c.bounds;
    entry.receivers = static_cast<uint32_t>(c.chunk.receivers.size());
    entry.first_cluster = static_cast<uint32_t>(m.clusters.size());
    entry.clusters = static_cast<uint32_t>(c.chunk.clusters.size());
    entry.first_probe = static_cast<uint32_t>(m.cell_probes.size());
    entry.probes = static_cast<uint32_t>(c.probe_ids.size());
    entry.chunk = cell_refs[i];
    entry.error = static_cast<float>(c.error);
    entry.unseen =
        c.stats.gather_rays > 0
            ? static_cast<float>(static_cast<double>(c.stats.unseen) / static_cast<double>(c.stats.gather_rays))
            : 0;
    for (const CellChunk::Cluster& k : c.chunk.clusters) {
      m.clusters.push_back({k.bounds, k.receivers, k.rank(), static_cast<uint32_t>(k.probes.size()), k.error});
    }
    for (const uint32_t p : c.probe_ids) {
      m.cell_probes.push_back(static_cast<uint32_t>(std::lower_bound(used.begin(), used.end(), p) - used.begin()));
    }
    m.cells.push_back(entry);
  }
  return m;
}

}  // namespace lightloom
