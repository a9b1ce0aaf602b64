// A .loom folder on disk: a manifest and content-addressed chunks.
#pragma once

#include <filesystem>
#include <span>
#include <vector>

#include "core/asset/chunk.h"
#include "core/asset/manifest.h"

namespace lightloom {

/// Content-addressed folder: a chunk's name is its SHA-256.
class ChunkStore {
 public:
  explicit ChunkStore(std::filesystem::path folder) : folder_(std::move(folder)) {}

  /// Atomic; a chunk that is already there is left alone, or replaced if its bytes are damaged.
  absl::StatusOr<ChunkRef> put(std::span<const uint8_t> bytes) const;
  /// Fails if the chunk is missing, or its size or digest differ.
  absl::StatusOr<std::vector<uint8_t>> get(const ChunkRef& ref) const;
  std::filesystem::path path(const Digest& digest) const;

 private:
  std::filesystem::path folder_;
};

/// OUT.loom/manifest and OUT.loom/chunks.
ChunkStore chunk_store(const std::filesystem::path& loom);
absl::Status write_manifest(const std::filesystem::path& loom, const Manifest& manifest);
absl::StatusOr<Manifest> read_manifest(const std::filesystem::path& loom);

/// Reads every chunk and checks that manifest and chunks agree: digests, counts, sizes, orders, object identities.
/// The error names the first chunk at fault.
absl::Status verify_asset(const std::filesystem::path& loom);

}  // namespace lightloom
