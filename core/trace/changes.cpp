#include "core/trace/changes.h"

#include <algorithm>

namespace lightloom {
namespace {

constexpr uint8_t kGeometry = 1, kReceivers = 2;

}  // namespace

Changes::Changes(const WorldContents& before, const WorldContents& after)
    : comparable_(before.grid.level == after.grid.level), level_(after.grid.level) {
  if (!comparable_) return;
  const auto contents_at = [](const WorldContents& world, const GridCell& cell) {
    if (!world.grid.contains(cell)) return CellContents{};
    const auto at = std::lower_bound(world.cells.begin(), world.cells.end(), world.grid.index(cell));
    if (at == world.cells.end() || *at != world.grid.index(cell)) return CellContents{};
    return world.contents[static_cast<size_t>(at - world.cells.begin())];
  };
  const auto compare = [&](const CellContents& was, const CellContents& is, const GridCell& cell) {
    const int what = (was.geometry == is.geometry ? 0 : kGeometry) | (was.receivers == is.receivers ? 0 : kReceivers);
    if (what != 0) changed_.push_back({cell, static_cast<uint8_t>(what)});
  };
  for (size_t i = 0; i < after.cells.size(); ++i) {
    const GridCell cell = after.grid.cell(after.cells[i]);
    compare(contents_at(before, cell), after.contents[i], cell);
  }
  for (size_t i = 0; i < before.cells.size(); ++i) {
    const GridCell cell = before.grid.cell(before.cells[i]);
    const CellContents is = contents_at(after, cell);
    if (is == CellContents{}) compare(before.contents[i], is, cell);
  }
}

double Changes::share(const Trace& trace, Reads reads) const {
  if (!comparable_ || trace.grid.level != level_) return 1;
  std::vector<uint8_t> changed(trace.grid.cells(), 0);
  uint8_t most = 0;
  bool any = false;
  for (const Changed& c : changed_) {
    if ((c.what & static_cast<uint8_t>(reads)) == 0) continue;
    if (trace.grid.contains(c.cell)) {
      changed[trace.grid.index(c.cell)] = 1;
      any = true;
    } else {
      most = std::max(most, trace.sky);  // rays that left the grid may meet it now
    }
  }
  if (any) {
    trace.for_each_run([&](uint32_t at, uint32_t cells, uint8_t share) {
      if (share > most && std::find(&changed[at], &changed[at] + cells, 1) != &changed[at] + cells) most = share;
    });
  }
  return share_of(most);
}

}  // namespace lightloom
