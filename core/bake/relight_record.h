// What the rest of a bake needs of probes' relight sets besides their chunks, and a later bake to use them again.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "core/asset/manifest.h"
#include "core/probes/probe_name.h"
#include "core/trace/trace.h"

namespace lightloom {

struct RelightRecord {
  ProbeName probe;
  Digest key;  ///< relight_key()
  ChunkRef chunk;
  Trace trace;
};

std::vector<uint8_t> encode_relight_records(const std::vector<RelightRecord>& records);
/// Checks every count against the bytes that are there, and the traces: DataLoss. Whether the probes exist, the plan's
/// owner must check.
absl::StatusOr<std::vector<RelightRecord>> decode_relight_records(std::span<const uint8_t> bytes);

}  // namespace lightloom
