// A folder of immutable files, each named by its SHA-256. Uploads may be cut and go on later.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <set>
#include <span>
#include <vector>

#include "bake-server/blobs/blob_layout.h"
#include "core/base/file.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// Thread-safe, and safe beside collect_garbage() of any process. A blob is there whole and right, or not at all: also
/// after whatever `durability` speaks of.
class BlobStore {
 public:
  static constexpr uint64_t kMostBytes = uint64_t{16} << 30;  ///< of a blob

  /// An error if there is no room for more.
  using CheckRoom = std::function<absl::Status()>;

  /// FOLDER/HH/H…H for blobs, FOLDER/uploads for parts. Errors name the folder. `check_room` is asked before each piece of
  /// an upload; null: there is always room.
  static absl::StatusOr<std::unique_ptr<BlobStore>> open(const std::filesystem::path& folder,
                                                         Durability durability = Durability::kPowerLoss,
                                                         CheckRoom check_room = nullptr);

  /// Whether it is there; if so, it was touched, and stays for the grace period of collect_garbage() even if nothing names
  /// it. Who puts a blob's name on record asks right before.
  bool has(const Digest& digest) const;
  /// InvalidArgument unless all are there, as by has().
  absl::Status require(const std::vector<Digest>& digests) const;
  /// Bytes of a blob; NotFound.
  absl::StatusOr<uint64_t> size(const Digest& digest) const;
  /// At most `most` bytes from `offset` on; none at the end.
  absl::StatusOr<std::vector<uint8_t>> read(const Digest& digest, uint64_t offset, uint64_t most) const;
  /// Its file holds other bytes, as a disk may have it: from now on the blob is not there, and can be put again.
  absl::Status set_damaged_aside(const Digest& digest);

  /// Bytes of the blob that have arrived; all of them: as has().
  uint64_t uploaded(const Digest& digest) const;
  /// The next piece of a blob of `size` bytes. The last one makes the blob, if its digest is right; else what came is
  /// dropped (DataLoss). Aborted: `offset` is not where the upload is; ask uploaded(). What check_room says: what came is
  /// dropped, too.
  absl::Status append(const Digest& digest, uint64_t size, uint64_t offset, std::span<const uint8_t> data);
  /// A blob that is at hand.
  absl::StatusOr<Digest> put(std::span<const uint8_t> bytes);

 private:
  BlobStore(const std::filesystem::path& folder, Durability durability, CheckRoom check_room)
      : layout_(folder), durability_(durability), check_room_(std::move(check_room)) {}
  absl::Status commit(const std::filesystem::path& temporary, const Digest& digest) const;
  absl::Status make_folder(const std::filesystem::path& folder) const;
  std::shared_ptr<std::mutex> turn(const Digest& digest);

  BlobLayout layout_;
  Durability durability_;
  CheckRoom check_room_;
  mutable std::mutex mutex_;
  mutable std::set<std::filesystem::path> made_;       // folders that are there, durably
  std::map<Digest, std::weak_ptr<std::mutex>> turns_;  // one upload of a blob at a time
};

}  // namespace lightloom
