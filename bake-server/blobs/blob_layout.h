// Where a blob store's folder keeps what. For the store itself and its upkeep.
#pragma once

#include <filesystem>
#include <utility>

#include "core/base/hash.h"

namespace lightloom {

class BlobLayout {
 public:
  explicit BlobLayout(std::filesystem::path folder) : folder_(std::move(folder)) {}

  const std::filesystem::path& folder() const { return folder_; }
  /// The blob itself, whole and right.
  std::filesystem::path blob(const Digest& digest) const {
    const std::string hex = digest.hex();
    return folder_ / hex.substr(0, 2) / hex.substr(2);
  }
  /// What has arrived of an upload, and what is about to be a blob.
  std::filesystem::path uploads() const { return folder_ / "uploads"; }
  std::filesystem::path part(const Digest& digest) const { return uploads() / digest.hex(); }
  /// A blob that nobody seems to need, for the moment in which the last look is taken. Whoever looks for it puts it back.
  std::filesystem::path trash() const { return folder_ / "trash"; }
  std::filesystem::path discarded(const Digest& digest) const { return trash() / digest.hex(); }
  /// Files that were found to hold other bytes than their names say, kept to be looked at.
  std::filesystem::path damaged() const { return folder_ / "damaged"; }

 private:
  std::filesystem::path folder_;
};

/// Puts a discarded blob back; false if there is none. What is at its place already stays.
bool restore_blob(const BlobLayout& layout, const Digest& digest);

}  // namespace lightloom
