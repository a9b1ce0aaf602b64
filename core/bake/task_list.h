// Tasks as a coordinator knows them: a kind and an argument, which it cannot read, and the blobs that came out.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

struct FinishedTask {
  std::string kind;
  std::vector<uint8_t> argument;
  std::vector<Digest> outputs;  ///< names of blobs
  bool operator==(const FinishedTask&) const = default;
};

/// The blob that a task of a later stage gets to read: all tasks of the stages below, in any order.
/// Bytes, little-endian: "LBTL", version 1, count; per task the sizes of kind and argument, the count of outputs
/// and 0, 32 bits each; all kinds and arguments, back to back; all outputs. Each array starts at a multiple of 16.
std::vector<uint8_t> encode_task_list(const std::vector<FinishedTask>& tasks);
/// Checks every count against the bytes that are there: DataLoss.
absl::StatusOr<std::vector<FinishedTask>> decode_task_list(std::span<const uint8_t> bytes);

}  // namespace lightloom
