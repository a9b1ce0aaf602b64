// A copy of a state folder, taken beside a server that works on it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/base/parallel.h"
#include "core/base/status.h"

namespace lightloom {

struct Backup {
  uint64_t blobs = 0, bytes = 0;  ///< that the copy holds
  uint64_t linked = 0;            ///< of these blobs: share their disk space with the original
};

/// Makes `to` a state folder with the jobs that `state` has at one moment, and the blobs that they name: hard links where
/// the file system allows, else copies, whose digests are checked. What is under `to` is there whole and on the disk, or
/// not at all: it is written beside and renamed. Garbage collection waits meanwhile, and this waits for one that runs.
/// FailedPrecondition: `state` is no state folder, or `to` is there and not empty. DataLoss: a blob is missing. Cancelled.
absl::StatusOr<Backup> back_up(const std::filesystem::path& state, const std::filesystem::path& to,
                               const CancelFlag* cancel = nullptr);

/// "5120 blobs, 8.0 GiB, 5120 of them linked".
std::string backup_text(const Backup& backup);

}  // namespace lightloom
