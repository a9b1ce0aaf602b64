// What a result was computed from: the cells of the world that its rays crossed, and how many of them.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/base/bytes.h"
#include "core/base/status.h"
#include "core/trace/world_grid.h"

namespace lightloom {

/// Shares of rays are kept as powers of two: s stands for 2^(s−15), 0 for none.
inline constexpr uint8_t kWholeShare = 15;
uint8_t stored_share(uint64_t count, uint64_t of);
inline double share_of(uint8_t stored) { return stored == 0 ? 0 : std::ldexp(1.0, stored - kWholeShare); }

/// The result depends on nothing outside of its cells; but if rays left the grid, also on there being nothing there.
struct Trace {
  WorldGrid grid;
  uint8_t sky = 0;  ///< share of rays that left the grid; 1 at least if anything did
  /// Runs of cells in the grid's order: the low four bits are their stored share, the high four how many less one.
  std::vector<uint8_t> runs;

  /// visit(index of the first cell, cells, stored share), without those of share 0.
  template <class Visit>
  void for_each_run(const Visit& visit) const {
    uint32_t at = 0;
    for (const uint8_t run : runs) {
      const uint32_t cells = (run >> 4) + 1u;
      if ((run & 15) != 0) visit(at, cells, static_cast<uint8_t>(run & 15));
      at += cells;
    }
  }
  bool operator==(const Trace&) const = default;
};

/// `shares`: stored, of every cell of the grid.
std::vector<uint8_t> pack_runs(std::span<const uint8_t> shares);

/// Whether its numbers are in range: DataLoss.
absl::Status check_grid(const WorldGrid& grid);

void write_trace(const Trace& trace, ByteWriter* out);
/// DataLoss unless the grid is sound and the runs cover it.
absl::StatusOr<Trace> read_trace(ByteReader* in);

}  // namespace lightloom
