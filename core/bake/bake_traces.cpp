#include "core/bake/bake_traces.h"

#include <algorithm>
#include <functional>
#include <string>
#include <string_view>

#include "core/base/bytes.h"

namespace lightloom {
namespace {

constexpr uint32_t kMagic = 0x5443424cu;  // "LBCT"
constexpr uint32_t kVersion = 1;

struct Header {
  uint32_t magic, version;
  WorldGrid grid;
  uint32_t contents;      // cells that are not empty
  uint32_t cell_records;  // lengths follow, then the records
  uint32_t relight_bytes;
  uint32_t reserved;
};
static_assert(sizeof(Header) == 52 && sizeof(CellContents) == 32);

absl::Status corrupt(std::string_view why) {
  return absl::DataLossError("the traces of the bake are corrupt: " + std::string(why) +
                             "; fetch the asset again, or bake it anew");
}

}  // namespace

std::vector<uint8_t> encode_bake_traces(const BakeTraces& t) {
  std::vector<uint32_t> lengths;
  std::vector<uint8_t> records;
  for (const CellRecord& cell : t.cells) {
    const auto bytes = encode_cell_record(cell);
    lengths.push_back(static_cast<uint32_t>(bytes.size()));
    records.insert(records.end(), bytes.begin(), bytes.end());
  }
  const auto relight = encode_relight_records(t.probes);
  ByteWriter w;
  w.value(Header{kMagic, kVersion, t.world.grid, static_cast<uint32_t>(t.world.cells.size()),
                 static_cast<uint32_t>(lengths.size()), static_cast<uint32_t>(relight.size()), 0});
  w.array(t.world.cells);
  w.array(t.world.contents);
  w.array(lengths);
  w.array(records);
  w.array(relight);
  return std::move(w).take();
}

absl::StatusOr<BakeTraces> decode_bake_traces(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<Header>();
  if (header.magic != kMagic) return corrupt("it does not start with LBCT");
  if (header.version != kVersion) return corrupt("version " + std::to_string(header.version) + " is unknown");
  if (const auto status = check_grid(header.grid); !status.ok()) return corrupt(std::string(status.message()));
  BakeTraces t;
  t.world.grid = header.grid;
  t.world.cells = r.array<uint32_t>(header.contents);
  t.world.contents = r.array<CellContents>(header.contents);
  const auto lengths = r.array<uint32_t>(header.cell_records);
  uint64_t record_bytes = 0;
  for (const uint32_t length : lengths) record_bytes += length;
  const auto records = r.array<uint8_t>(record_bytes);
  const auto relight = r.array<uint8_t>(header.relight_bytes);
  if (!r.at_end()) return corrupt("its length does not match its counts");

  const auto& cells = t.world.cells;
  if (std::adjacent_find(cells.begin(), cells.end(), std::greater_equal<>()) != cells.end() ||
      (!cells.empty() && cells.back() >= header.grid.cells())) {
    return corrupt("its world's cells do not ascend within the grid");
  }
  size_t at = 0;
  for (const uint32_t length : lengths) {
    LL_ASSIGN_OR_RETURN(CellRecord cell, decode_cell_record(std::span(records).subspan(at, length)));
    t.cells.push_back(std::move(cell));
    at += length;
  }
  LL_ASSIGN_OR_RETURN(t.probes, decode_relight_records(relight));
  return t;
}

}  // namespace lightloom
