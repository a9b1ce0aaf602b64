// Removes blobs that nothing names, beside a server that works: no lock stops uploads or submissions.
//
// Why no blob is lost that is named, or that somebody was told is there:
//
// - Promises. Who is told that a blob is there gets it touched first (BlobStore::has), and so does who puts its name on
//   record: a submission's inputs, a task's outputs. Both stay for the grace period from then on. A name that goes from one
//   record to another (a result that is used again) has been on record all the while.
// - Marking. What is on record is read at one moment M, after the age limit L = now - grace was taken. A name that came on
//   record after M was touched right before, so after L.
// - Sweeping. A blob that is not marked and older than L is renamed to trash/, then its age is looked at again, and only
//   then it is unlinked. A touch T is followed by a look at the blob's place, P. If T comes before the second look, the
//   blob is put back. If T comes after it, then P comes after the rename, and finds nothing: who asked is told
//   "missing", or finds what somebody else has uploaded meanwhile, which is young.
// - Being cut. A blob left in trash/ is put back by whoever looks for it, and by the next collection.
// - One collection at a time: UpkeepLock.
//
// Ages are by the clock that stamps the files. If it jumps ahead by more than the grace period, promises break, names on
// record do not: who finds a blob missing sends it again.
//
// Uploads that were cut promise nothing: where one goes on is asked and checked with every piece, and the blob's digest
// at the end.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <string>

#include "bake-server/store/store.h"
#include "core/base/parallel.h"
#include "core/base/status.h"

namespace lightloom {

struct GarbageOptions {
  int64_t grace_seconds = 3600;
  bool dry_run = false;  ///< only says what would go
  const CancelFlag* cancel = nullptr;
};

struct Garbage {
  uint64_t blobs = 0, uploads = 0;  ///< that went: blobs, and uploads that were cut
  uint64_t bytes = 0;               ///< of both
  uint64_t kept = 0, kept_bytes = 0;
};

/// Visits every digest on record at one moment (Store::referenced).
using References = std::function<absl::Status(const VisitDigest&)>;

/// Memory: 32 bytes per name on record. Unavailable: another collection or a backup works on the folder. Cancelled.
/// `state` is the folder that holds blobs/.
absl::StatusOr<Garbage> collect_garbage(const std::filesystem::path& state, const References& references,
                                        const GarbageOptions& options);

/// "freed 1.2 GiB: 340 blobs and 2 cut uploads; 5120 blobs stay (8.0 GiB)".
std::string garbage_text(const Garbage& garbage, bool dry_run);

}  // namespace lightloom
