#include "core/trace/trace.h"

#include <algorithm>
#include <cmath>

namespace lightloom {
namespace {

struct TraceHeader {
  WorldGrid grid;
  uint32_t sky, runs;
};
static_assert(sizeof(WorldGrid) == 28 && sizeof(TraceHeader) == 36);

}  // namespace

uint8_t stored_share(uint64_t count, uint64_t of) {
  if (count == 0 || of == 0) return 0;
  const int exponent = std::ilogb(static_cast<double>(count) / static_cast<double>(of));
  return static_cast<uint8_t>(std::clamp(kWholeShare + exponent, 1, int{kWholeShare}));
}

std::vector<uint8_t> pack_runs(std::span<const uint8_t> shares) {
  constexpr size_t kMostCells = 16;
  std::vector<uint8_t> runs;
  for (size_t at = 0; at < shares.size();) {
    size_t end = at + 1;
    while (end < shares.size() && end - at < kMostCells && shares[end] == shares[at]) ++end;
    runs.push_back(static_cast<uint8_t>((end - at - 1) << 4 | shares[at]));
    at = end;
  }
  return runs;
}

absl::Status check_grid(const WorldGrid& grid) {
  constexpr int32_t kSteepest = 60, kFarthest = (1 << 30) + 1;
  bool sound = std::abs(int64_t{grid.level}) <= kSteepest;
  for (size_t a = 0; a < 3; ++a) {
    sound &= grid.size[a] > 0 && grid.size[a] <= WorldGrid::kMostAlong && std::abs(int64_t{grid.lo[a]}) <= kFarthest;
  }
  if (sound && grid.cells() <= WorldGrid::kMostCells) return absl::OkStatus();
  return absl::DataLossError("a grid of the world is out of range");
}

void write_trace(const Trace& trace, ByteWriter* out) {
  out->value(TraceHeader{trace.grid, trace.sky, static_cast<uint32_t>(trace.runs.size())});
  out->array(trace.runs);
}

absl::StatusOr<Trace> read_trace(ByteReader* in) {
  const auto header = in->value<TraceHeader>();
  Trace trace{header.grid, static_cast<uint8_t>(header.sky), in->array<uint8_t>(header.runs)};
  if (!in->ok()) return absl::DataLossError("a trace is cut off");
  LL_RETURN_IF_ERROR(check_grid(trace.grid));
  if (header.sky > kWholeShare) return absl::DataLossError("a trace's share of the sky is out of range");
  uint64_t cells = 0;
  for (const uint8_t run : trace.runs) cells += (run >> 4) + 1u;
  if (cells != trace.grid.cells()) return absl::DataLossError("a trace does not cover its grid");
  return trace;
}

}  // namespace lightloom
