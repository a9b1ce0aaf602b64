// A folder of immutable files, each named by its SHA-256. Uploads may be cut and go on later.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "core/base/file.h"
#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

/// Thread-safe. A blob is there whole and right, or not at all: also after whatever `durability` speaks of.
class BlobStore {
 public:
  static constexpr uint64_t kMostBytes = uint64_t{16} << 30;  ///< of a blob

  /// FOLDER/HH/H…H for blobs, FOLDER/uploads for parts. Errors name the folder.
  static absl::StatusOr<std::unique_ptr<BlobStore>> open(const std::filesystem::path& folder,
                                                         Durability durability = Durability::kPowerLoss);

  bool has(const Digest& digest) const;
  /// Bytes of a blob; NotFound.
  absl::StatusOr<uint64_t> size(const Digest& digest) const;
  /// At most `most` bytes from `offset` on; none at the end.
  absl::StatusOr<std::vector<uint8_t>> read(const Digest& digest, uint64_t offset, uint64_t most) const;

  /// Bytes of the blob that have arrived.
  uint64_t uploaded(const Digest& digest) const;
  /// The next piece of a blob of `size` bytes. The last one makes the blob, if its digest is right; else what came is
  /// dropped (DataLoss). Aborted: `offset` is not where the upload is; ask uploaded().
  absl::Status append(const Digest& digest, uint64_t size, uint64_t offset, std::span<const uint8_t> data);
  /// A blob that is at hand.
  absl::StatusOr<Digest> put(std::span<const uint8_t> bytes);

 private:
  BlobStore(std::filesystem::path folder, Durability durability)
      : folder_(std::move(folder)), durability_(durability) {}
  absl::Status commit(const std::filesystem::path& temporary, const Digest& digest) const;
  std::filesystem::path path(const Digest& digest) const;
  std::filesystem::path part(const Digest& digest) const;
  std::shared_ptr<std::mutex> turn(const Digest& digest);

  std::filesystem::path folder_;
  Durability durability_;
  std::mutex mutex_;
  std::map<Digest, std::weak_ptr<std::mutex>> turns_;  // one upload of a blob at a time
};

}  // namespace lightloom
