#include "runtime/streaming/plan.h"

#include <algorithm>
#include <cmath>

#include "core/base/sh.h"

namespace lightloom {
namespace {

/// What a level keeps of a cell, and the relative error of E by which fewer bands go wrong (docs/results.md,
/// "Streaming").
struct CellModel {
  uint32_t max_rank, bands;
  double band_error;
};
constexpr CellModel kCellModels[] = {{0, 1, 1}, {4, 4, 0.052}, {16, 4, 0.052}, {UINT32_MAX, UINT32_MAX, 0}};
/// That coarse rays add.
constexpr double kCoarseRaysError = 0.053;
/// What is resident is worth so much more than what is not.
constexpr double kHysteresis = 1.25;

const CellModel& model_of(CellLevel level) { return kCellModels[static_cast<size_t>(level)]; }

/// What the near fields of a cell take, of which the manifest says nothing: so many entries of 6 bytes may be in the chunk
/// besides all else. Its base has one for each receiver at most.
uint64_t near_bytes(const AssetIndex::Cell& cell, std::span<const AssetIndex::Cluster> clusters, uint32_t order,
                    bool base) {
  const uint64_t stride = static_cast<uint64_t>(sh_stride(static_cast<int>(order)));
  uint64_t others = 64;
  for (const AssetIndex::Cluster& c : clusters) {
    others += 2 * c.rank * (c.probes * stride + (c.receivers + uint64_t{7}) / 8 * 8);
    others += 4 * c.rank + 4 * c.probes + 48 + (8 + 2 + 2) * uint64_t{c.receivers};
  }
  uint64_t entries = (cell.chunk.size - std::min(cell.chunk.size, others)) / 6;
  if (base) entries = std::min<uint64_t>(entries, cell.receivers);
  return 8 * entries + 4 * uint64_t{cell.receivers};
}

/// The bytes of runtime/cell_block.h but for near_bytes.
uint64_t cell_bytes(std::span<const AssetIndex::Cluster> clusters, uint32_t order, const CellModel& model) {
  const uint64_t stride = static_cast<uint64_t>(sh_stride(static_cast<int>(std::min(order, model.bands - 1))));
  uint64_t bytes = 320;
  for (const AssetIndex::Cluster& c : clusters) {
    const uint64_t rank = std::min(c.rank, model.max_rank), octets = (c.receivers + uint64_t{7}) / 8;
    bytes += 2 * rank * (c.probes * stride + 8 * octets)  // matrices
             + 20 * (rank + 1)                            // corrections, coefficients
             + octets * (8 + 8 * (4 + 2)) + 4 * c.probes + 48;
  }
  return bytes;
}

/// Relative error of E at a level. What columns leave out falls like 1/(1 + K/2.5), measured; those that were not baked
/// cost nothing here.
double error_at(std::span<const AssetIndex::Cluster> clusters, uint32_t order, CellLevel level) {
  const auto left = [](uint32_t rank) { return 0.62 / (1 + rank / 2.5); };
  const CellModel& model = model_of(level);
  double error = 0, receivers = 0;
  for (const AssetIndex::Cluster& c : clusters) {
    error += c.receivers * (left(std::min(c.rank, model.max_rank)) - left(c.rank));
    receivers += c.receivers;
  }
  return std::hypot(error / std::max(1.0, receivers), order + 1 > model.bands ? model.band_error : 0);
}

}  // namespace

Detail detail_of(CellLevel level) {
  return {model_of(level).max_rank, model_of(level).bands, true, level == CellLevel::kBase};
}
Detail detail_of(ProbeLevel level) {
  const bool base = level == ProbeLevel::kBase;
  return {UINT32_MAX, UINT32_MAX, !base, base};
}

StreamCosts::StreamCosts(const AssetIndex& index) {
  for (uint32_t c = 0; c < index.cells().size(); ++c) {
    auto& costs = cells_.emplace_back();
    for (const CellLevel level : {CellLevel::kBase, CellLevel::kSome, CellLevel::kAll}) {
      uint64_t& cost = costs[static_cast<size_t>(level)];
      cost = cell_bytes(index.clusters_of(c), index.order(), model_of(level)) +
             near_bytes(index.cells()[c], index.clusters_of(c), index.order(), level == CellLevel::kBase);
      if (level != CellLevel::kBase) cost += costs[static_cast<size_t>(CellLevel::kBase)];
    }
  }
  // A bit per tile of 64 elements (runtime/vulkan/asset.h).
  const uint64_t tiles = 4 * (index.surface_elements() / 64 / 32 + uint64_t{1});
  const uint64_t coarse = coarse_rays(index.rays()).size();
  probe_[1] = 4 * coarse + tiles;
  probe_[2] = probe_[1] + (coarse < index.rays() ? 4 * uint64_t{index.rays()} + tiles : 0);
}

std::vector<StreamStep> rank_steps(const AssetIndex& index, const StreamCosts& costs, std::span<const float> importance,
                                   const StreamLevels& now) {
  std::vector<StreamStep> steps;
  std::vector<double> probe_importance(index.probes().size());
  for (uint32_t c = 0; c < index.cells().size(); ++c) {
    const double seen = static_cast<double>(importance[c]);
    for (const uint32_t p : index.probes_of(c)) probe_importance[p] += seen / index.cells()[c].probes;

    const auto error = [&](CellLevel level) { return error_at(index.clusters_of(c), index.order(), level); };
    const auto step = [&](CellLevel from, CellLevel to) {
      StreamStep s{AssetIndex::Kind::kCell, c, static_cast<uint8_t>(to), costs.cell(c, to) - costs.cell(c, from), 0};
      s.density = seen * (error(from) - error(to)) / static_cast<double>(std::max<uint64_t>(1, s.bytes));
      if (now.cells[c] >= to) s.density *= kHysteresis;
      return s;
    };
    if (error(CellLevel::kBase) <= error(CellLevel::kAll)) continue;  // it is all in the base
    StreamStep some = step(CellLevel::kBase, CellLevel::kSome), all = step(CellLevel::kSome, CellLevel::kAll);
    // A step that is worth less than the one after it is no stop.
    if (some.density > all.density) steps.push_back(some);
    steps.push_back(some.density > all.density ? all : step(CellLevel::kBase, CellLevel::kAll));
  }
  const uint64_t probe_bytes = costs.probe(ProbeLevel::kAll) - costs.probe(ProbeLevel::kBase);
  for (uint32_t p = 0; p < index.probes().size(); ++p) {
    if (index.cells_of(p).empty() || probe_bytes == 0) continue;  // the base has all rays
    StreamStep s{AssetIndex::Kind::kRelight, p, static_cast<uint8_t>(ProbeLevel::kAll), probe_bytes, 0};
    s.density = kCoarseRaysError * probe_importance[p] / static_cast<double>(probe_bytes);
    if (now.probes[p] == ProbeLevel::kAll) s.density *= kHysteresis;
    steps.push_back(s);
  }
  std::stable_sort(steps.begin(), steps.end(),
                   [](const StreamStep& a, const StreamStep& b) { return a.density > b.density; });
  return steps;
}

StreamLevels choose_levels(const AssetIndex& index, const StreamCosts& costs, std::span<const StreamStep> steps,
                           uint64_t budget) {
  StreamLevels levels;
  levels.cells.assign(index.cells().size(), CellLevel::kBase);
  levels.probes.assign(index.probes().size(), ProbeLevel::kNone);
  uint64_t used = 0;
  for (uint32_t c = 0; c < levels.cells.size(); ++c) used += costs.cell(c, CellLevel::kBase);
  for (uint32_t p = 0; p < levels.probes.size(); ++p) {
    if (index.cells_of(p).empty()) continue;
    levels.probes[p] = ProbeLevel::kBase;
    used += costs.probe(ProbeLevel::kBase);
  }
  // What does not fit is passed over, and what lies above it in the same cell.
  std::vector<bool> stopped(levels.cells.size());
  for (const StreamStep& s : steps) {
    if (s.density <= 0) break;
    const bool is_cell = s.kind == AssetIndex::Kind::kCell;
    if (used + s.bytes > budget || (is_cell && stopped[s.index])) {
      if (is_cell) stopped[s.index] = true;
      continue;
    }
    used += s.bytes;
    if (is_cell) {
      levels.cells[s.index] = static_cast<CellLevel>(s.level);
    } else {
      levels.probes[s.index] = static_cast<ProbeLevel>(s.level);
    }
  }
  return levels;
}

}  // namespace lightloom
