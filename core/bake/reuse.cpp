#include "core/bake/reuse.h"

#include <algorithm>
#include <map>

#include "core/bake/tasks.h"
#include "core/trace/changes.h"

namespace lightloom {
namespace {

template <class Record>
std::map<Digest, uint32_t> by_key(const std::vector<Record>& records) {
  std::map<Digest, uint32_t> out;
  for (uint32_t i = 0; i < records.size(); ++i) out.emplace(records[i].key, i);
  return out;
}

template <class Record>
ReuseItem look_up(const Digest& key, const std::vector<Record>& earlier, const std::map<Digest, uint32_t>& index,
                  const Changes& changes) {
  const auto found = index.find(key);
  if (found == index.end()) return {};
  const double share = changes.share(earlier[found->second].trace);
  return {share > 0 ? ReuseItem::kCrossed : ReuseItem::kHolds, found->second, share};
}

/// Whether the texels that its near fields name are still there.
bool names_receivers(const CellRecord& cell, const Plan& plan, const std::map<Digest, uint32_t>& objects) {
  return std::all_of(cell.near.begin(), cell.near.end(), [&](const NearSurface& near) {
    const auto it = objects.find(near.object.id);
    if (it == objects.end()) return false;
    const LightmapUv& uv = plan.layout.uv[it->second];
    return static_cast<uint32_t>(uv.width) == near.object.width &&
           static_cast<uint32_t>(uv.height) == near.object.height &&
           std::all_of(near.keys.begin(), near.keys.end(),
                       [&](uint32_t key) { return plan.receivers.find(it->second, key) != Receivers::kNone; });
  });
}

}  // namespace

Reuse no_reuse(const Plan& plan) {
  return {std::vector<ReuseItem>(plan.cells.size()), std::vector<ReuseItem>(plan.placement.probes.size())};
}

absl::StatusOr<Reuse> find_reuse(const Plan& plan, const Scene& scene, const WorldContents& now,
                                 const BakeTraces& earlier, double tolerance, const Parallel& parallel) {
  const Changes changes(earlier.world, now);
  const auto cells = by_key(earlier.cells), probes = by_key(earlier.probes);
  const auto& planned = plan.placement.probes;
  std::map<Digest, uint32_t> objects;
  for (uint32_t o = 0; o < scene.objects.size(); ++o) objects.emplace(scene.objects[o].id, o);
  Reuse out;
  out.cells.resize(plan.cells.size());
  out.probes.resize(planned.size());
  const bool done = parallel_for(out.cells.size() + out.probes.size(), parallel, [&](uint64_t i) {
    if (i < out.cells.size()) {
      ReuseItem& item = out.cells[i];
      item = look_up(cell_key(plan, scene, plan.cells[i]), earlier.cells, cells, changes);
      if (item.why == ReuseItem::kUnknown) return;
      item.share = std::min(1.0, item.share + static_cast<double>(earlier.cells[item.earlier].stale));
      const bool stands = item.share == 0 || names_receivers(earlier.cells[item.earlier], plan, objects);
      item.why = item.share > tolerance || !stands ? ReuseItem::kCrossed : ReuseItem::kHolds;
      return;
    }
    i -= out.cells.size();
    out.probes[i] = look_up(relight_key(plan, planned[i]), earlier.probes, probes, changes);
  });
  if (!done) return absl::CancelledError("cancelled while looking for what an edit has changed");
  return out;
}

std::vector<uint32_t> dirty_first(std::span<const ReuseItem> items) {
  std::vector<uint32_t> dirty;
  for (uint32_t i = 0; i < items.size(); ++i) {
    if (items[i].why != ReuseItem::kHolds) dirty.push_back(i);
  }
  std::stable_sort(dirty.begin(), dirty.end(), [&](uint32_t a, uint32_t b) { return items[a].share > items[b].share; });
  return dirty;
}

}  // namespace lightloom
