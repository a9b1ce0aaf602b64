// A copy of a state folder, taken beside a server that works on it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>

#include "core/base/hash.h"
#include "core/base/parallel.h"
#include "core/base/status.h"

namespace lightloom {

struct Backup {
  uint64_t blobs = 0, bytes = 0;  ///< that the copy holds
  uint64_t linked = 0;            ///< of these blobs: share their disk space with the original
  uint64_t missing = 0;           ///< that a job names, but are not there, or damaged where they had to be copied
  Digest first_missing;           ///< if any
};

/// Makes `to` a state folder with the jobs that `state`, or the PostgreSQL `database` beside it, has at one moment, and the blobs that they name: hard links where
/// the file system allows, else copies, whose digests are checked. What is under `to` is there whole and on the disk, or
/// not at all: it is written beside and renamed. Garbage collection waits meanwhile, and this waits for one that runs.
/// Blobs that are missing in `state` are missing in the copy, which holds all else. FailedPrecondition: `state` is no state
/// folder, `to` lies in it, or is there and not empty. Cancelled.
absl::StatusOr<Backup> back_up(const std::filesystem::path& state, const std::filesystem::path& to,
                               const CancelFlag* cancel = nullptr, const std::string& database = "");

/// Puts the jobs of a backup into a PostgreSQL database that has none; its blobs are the folder's. A SQLite server needs no such
/// step: a backup is a state folder.
absl::Status restore(const std::filesystem::path& from, const std::string& database);

/// "5120 blobs, 8.0 GiB, 5120 of them linked".
std::string backup_text(const Backup& backup);

/// DataLoss, one line, if blobs are missing in the backup `to`.
absl::Status check_whole(const Backup& backup, const std::filesystem::path& to);

}  // namespace lightloom
