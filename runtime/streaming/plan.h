// What of an asset should be resident: the most light for the bytes. Pure: no I/O, no clock.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "runtime/asset_index.h"
#include "runtime/detail.h"

namespace lightloom {

/// How much of a cell is resident, each more than the one before. Every cell has its base as soon as it can: nothing is
/// black, and the light that bounces between cells keeps its energy.
enum class CellLevel : uint8_t { kNone, kBase, kSome, kAll };
inline constexpr uint32_t kCellLevels = 4;
enum class ProbeLevel : uint8_t { kNone, kBase, kAll };
Detail detail_of(CellLevel level);
Detail detail_of(ProbeLevel level);

/// Device memory that levels take, about. Details lie over the base: a cell at kAll takes kBase's bytes too.
class StreamCosts {
 public:
  explicit StreamCosts(const AssetIndex& index);
  uint64_t cell(uint32_t cell, CellLevel level) const { return cells_[cell][static_cast<size_t>(level)]; }
  uint64_t probe(ProbeLevel level) const { return probe_[static_cast<size_t>(level)]; }

 private:
  std::vector<std::array<uint64_t, kCellLevels>> cells_;
  std::array<uint64_t, 3> probe_{};
};

/// A level per cell and probe.
struct StreamLevels {
  std::vector<CellLevel> cells;
  std::vector<ProbeLevel> probes;
};

/// One step up: a cell or a probe to `level`.
struct StreamStep {
  AssetIndex::Kind kind = AssetIndex::Kind::kCell;
  uint32_t index = 0;
  uint8_t level = 0;   ///< CellLevel or ProbeLevel
  uint64_t bytes = 0;  ///< more than the step before
  double density = 0;  ///< light gained per byte
};

/// All steps above the bases, the best first; those of a cell in order. `importance`: per cell, share of what is seen
/// from where the camera is. What is resident in `now` counts for a little more, so that nothing is dropped and loaded
/// in turn.
std::vector<StreamStep> rank_steps(const AssetIndex& index, const StreamCosts& costs, std::span<const float> importance,
                                   const StreamLevels& now);

/// Bases everywhere, and the best steps that fit `budget` together.
StreamLevels choose_levels(const AssetIndex& index, const StreamCosts& costs, std::span<const StreamStep> steps,
                           uint64_t budget);

}  // namespace lightloom
