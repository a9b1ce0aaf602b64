// What an edit has changed, and which results it may have reached.
#pragma once

#include <cstdint>
#include <vector>

#include "core/trace/trace.h"
#include "core/trace/world_contents.h"

namespace lightloom {

/// What a result reads of the cells in its trace.
enum class Reads : uint8_t { kGeometry = 1, kGeometryAndReceivers = 3 };

/// Keeps no reference to its arguments.
class Changes {
 public:
  /// Grids of different cells cannot be compared: then everything has changed.
  Changes(const WorldContents& before, const WorldContents& after);

  /// The largest share of a result's rays that crossed one of the cells that have changed, at most 1; 0 proves that the
  /// result would come out the same. `trace` is of a level whose contents were those before, where it reaches.
  double share(const Trace& trace, Reads reads) const;

  /// Cells that have changed, in what anything reads.
  uint64_t cells() const { return changed_.size(); }

 private:
  struct Changed {
    GridCell cell;
    uint8_t what;  ///< Reads
  };
  bool comparable_;
  int32_t level_;
  std::vector<Changed> changed_;
};

}  // namespace lightloom
