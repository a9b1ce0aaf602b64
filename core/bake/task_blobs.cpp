#include "core/bake/task_blobs.h"

#include <string>
#include <string_view>

#include "core/bake/plan.h"
#include "core/base/bytes.h"
#include "core/base/text.h"
#include "core/base/version.h"

namespace lightloom {
namespace {

constexpr uint32_t kLayout = 2;                   // the version of these bytes
constexpr uint32_t kPayloadMagic = 0x4150424cu;   // "LBPA"
constexpr uint32_t kArgumentMagic = 0x5241424cu;  // "LBAR"
constexpr uint32_t kSummaryMagic = 0x5350424cu;   // "LBPS"
constexpr uint32_t kRefsMagic = 0x4c43424cu;      // "LBCL"
constexpr uint32_t kEarlierMagic = 0x4145424cu;   // "LBEA"
constexpr uint32_t kReusedMagic = 0x5552424cu;    // "LBRU"

struct Tag {
  uint32_t magic, version;
};
struct PayloadRecord {
  Tag tag;
  Digest scene;
  BakeParams params;
  uint32_t method_bytes, reserved;  // the method's name follows
};
struct ArgumentRecord {
  Tag tag;
  Digest plan;
  uint32_t first, count;
};
struct SummaryRecord {
  Tag tag;
  Digest plan;
  uint64_t receivers;
  uint32_t cells, probes, objects, reserved;
};
struct RefsHeader {
  Tag tag;
  uint64_t refs;
};
struct EarlierRecord {
  Tag tag;
  Digest traces;
  double tolerance;
};
struct ReusedHeader {
  Tag tag;
  Digest traces;
  uint32_t cells, probes;
};
static_assert(sizeof(BakeParams) == 64 && sizeof(PayloadRecord) == 112 && sizeof(ArgumentRecord) == 48 &&
              sizeof(SummaryRecord) == 64 && sizeof(RefsHeader) == 16 && sizeof(EarlierRecord) == 48 &&
              sizeof(ReusedHeader) == 48 && sizeof(ChunkRef) == 40);

absl::Status corrupt(std::string_view what, std::string_view why) {
  return absl::InvalidArgumentError(std::string(what) + " is corrupt: " + std::string(why) +
                                    "; submit the bake again, with a lightloom of this worker's release");
}

absl::Status check_tag(std::string_view what, const Tag& tag, uint32_t magic) {
  if (tag.magic != magic) return corrupt(what, "it starts with other bytes");
  if (tag.version != kLayout) return corrupt(what, "version " + std::to_string(tag.version) + " is unknown");
  return absl::OkStatus();
}

/// A record and nothing else.
template <class Record>
absl::StatusOr<Record> read_record(std::string_view what, std::span<const uint8_t> bytes, uint32_t magic) {
  ByteReader r(bytes);
  const auto record = r.value<Record>();
  LL_RETURN_IF_ERROR(check_tag(what, record.tag, magic));
  if (!r.at_end()) return corrupt(what, "its length is wrong");
  return record;
}

template <class Record>
std::vector<uint8_t> write_record(const Record& record) {
  ByteWriter w;
  w.value(record);
  return std::move(w).take();
}

}  // namespace

std::vector<uint8_t> encode_payload(const BakePayload& p) {
  ByteWriter w;
  w.value(PayloadRecord{{kPayloadMagic, kLayout}, p.scene, p.params, static_cast<uint32_t>(kMethodVersion.size()), 0});
  w.array(std::vector<char>(kMethodVersion.begin(), kMethodVersion.end()));
  return std::move(w).take();
}

absl::StatusOr<BakePayload> decode_payload(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto record = r.value<PayloadRecord>();
  LL_RETURN_IF_ERROR(check_tag("payload", record.tag, kPayloadMagic));
  const auto method = r.array<char>(record.method_bytes);
  if (!r.at_end() || method.empty()) return corrupt("payload", "its length is wrong");
  const std::string_view asked(method.data(), method.size());
  if (asked != kMethodVersion) {
    return absl::FailedPreconditionError("payload asks for method '" + printable(asked) + "', this worker bakes by '" +
                                         std::string(kMethodVersion) + "'; use a worker of the client's release");
  }
  if (absl::Status status = check_params(record.params); !status.ok()) {
    return absl::Status(status.code(), "payload: " + std::string(status.message()));
  }
  return BakePayload{record.scene, record.params};
}

std::vector<uint8_t> encode_argument(const TaskArgument& a) {
  return write_record(ArgumentRecord{{kArgumentMagic, kLayout}, a.plan, a.first, a.count});
}

absl::StatusOr<TaskArgument> decode_argument(std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const auto record, read_record<ArgumentRecord>("task argument", bytes, kArgumentMagic));
  return TaskArgument{record.plan, record.first, record.count};
}

std::vector<uint8_t> encode_earlier_results(const EarlierResults& e) {
  return write_record(EarlierRecord{{kEarlierMagic, kLayout}, e.traces, e.tolerance});
}

absl::StatusOr<EarlierResults> decode_earlier_results(std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const auto record, read_record<EarlierRecord>("argument of plan", bytes, kEarlierMagic));
  if (!(record.tolerance >= 0 && record.tolerance <= 1)) {
    return corrupt("argument of plan", "its tolerance is out of range");
  }
  return EarlierResults{record.traces, record.tolerance};
}

std::vector<uint8_t> encode_reused_results(const ReusedResults& reused) {
  ByteWriter w;
  w.value(ReusedHeader{{kReusedMagic, kLayout},
                       reused.traces,
                       static_cast<uint32_t>(reused.cells.size()),
                       static_cast<uint32_t>(reused.probes.size())});
  w.array(reused.cells);
  w.array(reused.probes);
  return std::move(w).take();
}

absl::StatusOr<ReusedResults> decode_reused_results(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<ReusedHeader>();
  LL_RETURN_IF_ERROR(check_tag("list of reused results", header.tag, kReusedMagic));
  ReusedResults reused{header.traces, r.array<ReusedResults::Item>(header.cells),
                       r.array<ReusedResults::Item>(header.probes)};
  if (!r.at_end()) return corrupt("list of reused results", "its length does not match its counts");
  for (const ReusedResults::Item& item : reused.cells) {
    if (!(item.stale >= 0 && item.stale <= 1)) return corrupt("list of reused results", "a staleness is out of range");
  }
  return reused;
}

std::vector<uint8_t> encode_plan_summary(const PlanSummary& s) {
  return write_record(SummaryRecord{{kSummaryMagic, kLayout}, s.plan, s.receivers, s.cells, s.probes, s.objects, 0});
}

absl::StatusOr<PlanSummary> decode_plan_summary(std::span<const uint8_t> bytes) {
  LL_ASSIGN_OR_RETURN(const auto record, read_record<SummaryRecord>("plan summary", bytes, kSummaryMagic));
  return PlanSummary{record.plan, record.receivers, record.cells, record.probes, record.objects};
}

std::vector<uint8_t> encode_chunk_refs(const std::vector<ChunkRef>& refs) {
  ByteWriter w;
  w.value(RefsHeader{{kRefsMagic, kLayout}, refs.size()});
  w.array(refs);
  return std::move(w).take();
}

absl::StatusOr<std::vector<ChunkRef>> decode_chunk_refs(std::span<const uint8_t> bytes) {
  ByteReader r(bytes);
  const auto header = r.value<RefsHeader>();
  LL_RETURN_IF_ERROR(check_tag("chunk list", header.tag, kRefsMagic));
  auto refs = r.array<ChunkRef>(header.refs);
  if (!r.at_end()) return corrupt("chunk list", "its length does not match its count");
  return refs;
}

}  // namespace lightloom
