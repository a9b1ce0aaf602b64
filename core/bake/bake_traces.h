// What a bake leaves for the next one, which need not do again what an edit cannot have reached: what the world held, and
// where every result's rays went.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/bake/cell_record.h"
#include "core/bake/relight_record.h"
#include "core/trace/world_contents.h"

namespace lightloom {

struct BakeTraces {
  WorldContents world;
  std::vector<CellRecord> cells;
  std::vector<RelightRecord> probes;
};

std::vector<uint8_t> encode_bake_traces(const BakeTraces& traces);
/// Trusts nothing, as the decoders of the records: DataLoss.
absl::StatusOr<BakeTraces> decode_bake_traces(std::span<const uint8_t> bytes);

}  // namespace lightloom
