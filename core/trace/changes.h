// What an edit has changed, and which results it may have reached.
#pragma once

#include <cstdint>
#include <vector>

#include "core/trace/trace.h"
#include "core/trace/world_contents.h"

namespace lightloom {

/// Keeps no reference to its arguments.
class Changes {
 public:
  /// Grids of different cells cannot be compared: then everything has changed.
  Changes(const WorldContents& before, const WorldContents& after);

  /// The largest share of a result's rays that crossed one of the cells that have changed, at most 1; 0 proves that the
  /// result would come out the same. `trace` is of a level whose contents were those before, where it reaches.
  double share(const Trace& trace) const;

  /// Cells that have changed.
  uint64_t cells() const { return changed_.size(); }

 private:
  bool comparable_;
  int32_t level_;
  std::vector<GridCell> changed_;
};

}  // namespace lightloom
