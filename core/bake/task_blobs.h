// The bytes by which tasks of a bake speak to each other; whoever hands them on need not read them. Little-endian, with
// magic and version. Decoders trust nothing: sizes must match, numbers be in range.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/asset/manifest.h"

namespace lightloom {

/// What a job bakes: all of its tasks get this.
struct BakePayload {
  Digest scene;  ///< of the blob that holds the level's .glb
  BakeParams params;
  bool operator==(const BakePayload&) const = default;
};
/// Also says which method it asks for: this program's.
std::vector<uint8_t> encode_payload(const BakePayload& payload);
/// Errors: InvalidArgument (corrupt, or parameters out of range), FailedPrecondition (another method's).
absl::StatusOr<BakePayload> decode_payload(std::span<const uint8_t> bytes);

/// The argument of every kind but "plan".
struct TaskArgument {
  Digest plan;  ///< BakeSession::plan_digest() of who asked for it
  uint32_t first = 0, count = 0;
  bool operator==(const TaskArgument&) const = default;
};
std::vector<uint8_t> encode_argument(const TaskArgument& argument);
absl::StatusOr<TaskArgument> decode_argument(std::span<const uint8_t> bytes);

/// The argument of "plan" where an earlier bake may be used again. Else it has none.
struct EarlierResults {
  Digest traces;         ///< blob of its encode_bake_traces()
  double tolerance = 0;  ///< see find_reuse(); in [0, 1]
  bool operator==(const EarlierResults&) const = default;
};
std::vector<uint8_t> encode_earlier_results(const EarlierResults& earlier);
absl::StatusOr<EarlierResults> decode_earlier_results(std::span<const uint8_t> argument);

/// Which results of an earlier bake "plan" found to hold: nobody is asked for them.
struct ReusedResults {
  struct Item {
    static constexpr uint32_t kNone = 0xffffffffu;
    uint32_t earlier = kNone;  ///< index in the traces
    float stale = 0;           ///< of a cell's record, from now on
    bool operator==(const Item&) const = default;
  };
  Digest traces;                    ///< the earlier bake's
  std::vector<Item> cells, probes;  ///< for each that is planned
  bool operator==(const ReusedResults&) const = default;
};
std::vector<uint8_t> encode_reused_results(const ReusedResults& reused);
absl::StatusOr<ReusedResults> decode_reused_results(std::span<const uint8_t> bytes);

/// What "plan" found: for people and progress bars.
struct PlanSummary {
  Digest plan;
  uint64_t receivers = 0;
  uint32_t cells = 0, probes = 0, objects = 0;
  bool operator==(const PlanSummary&) const = default;
};
std::vector<uint8_t> encode_plan_summary(const PlanSummary& summary);
absl::StatusOr<PlanSummary> decode_plan_summary(std::span<const uint8_t> bytes);

/// Names chunks; some may be absent (size 0).
std::vector<uint8_t> encode_chunk_refs(const std::vector<ChunkRef>& refs);
absl::StatusOr<std::vector<ChunkRef>> decode_chunk_refs(std::span<const uint8_t> bytes);

}  // namespace lightloom
