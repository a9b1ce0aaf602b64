#include "core/trace/changes.h"

#include <algorithm>

namespace lightloom {

Changes::Changes(const WorldContents& before, const WorldContents& after)
    : comparable_(before.grid.level == after.grid.level), level_(after.grid.level) {
  if (!comparable_) return;
  const auto contents_at = [](const WorldContents& world, const GridCell& cell) {
    if (!world.grid.contains(cell)) return CellContents{};
    const auto at = std::lower_bound(world.cells.begin(), world.cells.end(), world.grid.index(cell));
    if (at == world.cells.end() || *at != world.grid.index(cell)) return CellContents{};
    return world.contents[static_cast<size_t>(at - world.cells.begin())];
  };
  for (size_t i = 0; i < after.cells.size(); ++i) {
    const GridCell cell = after.grid.cell(after.cells[i]);
    if (contents_at(before, cell) != after.contents[i]) changed_.push_back(cell);
  }
  for (size_t i = 0; i < before.cells.size(); ++i) {
    const GridCell cell = before.grid.cell(before.cells[i]);
    if (before.contents[i] != CellContents{} && contents_at(after, cell) == CellContents{}) changed_.push_back(cell);
  }
}

double Changes::share(const Trace& trace) const {
  if (!comparable_ || trace.grid.level != level_) return 1;
  std::vector<uint8_t> changed(trace.grid.cells(), 0);
  uint8_t most = 0;
  bool any = false;
  for (const GridCell& cell : changed_) {
    if (trace.grid.contains(cell)) {
      changed[trace.grid.index(cell)] = 1;
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
