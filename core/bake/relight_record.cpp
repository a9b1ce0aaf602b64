#include "core/bake/relight_record.h"

#include <string>
#include <string_view>

#include "core/base/bytes.h"

namespace lightloom {
namespace {

constexpr uint32_t kMagic = 0x5252424cu;  // "LBRR"
constexpr uint32_t kVersion = 1;

struct Header {
  uint32_t magic, version, records, reserved;
};
struct Fixed {
  ProbeName probe;
  Digest key;
  ChunkRef chunk;
};
static_assert(sizeof(Fixed) == 88);

absl::Status corrupt(std::string_view why) {
  return absl::DataLossError("list of relight records is corrupt: " + std::string(why) + "; run their task again");
}

}  // namespace

std::vector<uint8_t> encode_relight_records(const std::vector<RelightRecord>& records) {
  ByteWriter w;
  w.value(Header{kMagic, kVersion, static_cast<uint32_t>(records.size()), 0});
  for (const RelightRecord& r : records) {
    w.value(Fixed{r.probe, r.key, r.chunk});
    write_trace(r.trace, &w);
  }
  return std::move(w).take();
}

absl::StatusOr<std::vector<RelightRecord>> decode_relight_records(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<Header>();
  if (header.magic != kMagic) return corrupt("it does not start with LBRR");
  if (header.version != kVersion) return corrupt("version " + std::to_string(header.version) + " is unknown");
  std::vector<RelightRecord> records;
  for (uint32_t i = 0; i < header.records; ++i) {
    const auto fixed = r.value<Fixed>();
    auto trace = read_trace(&r);
    if (!trace.ok()) return corrupt(std::string(trace.status().message()));
    if (fixed.chunk.size == 0) return corrupt("it names no chunk");
    records.push_back({fixed.probe, fixed.key, fixed.chunk, *std::move(trace)});
  }
  if (!r.at_end()) return corrupt("its length does not match its count");
  return records;
}

}  // namespace lightloom
