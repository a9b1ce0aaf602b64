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
/// Puts the manifest in force, whole or not at all. `traces`, if not empty: what the next bake wants to know of this one
/// (core/bake/bake_traces.h). They stand in a file whose name is the manifest's SHA-256, so that an asset never has
/// another bake's; no runtime reads them, and an asset without them is whole. Those of other manifests are removed.
absl::Status write_manifest(const std::filesystem::path& loom, const Manifest& manifest,
                            std::span<const uint8_t> traces = {});
absl::StatusOr<Manifest> read_manifest(const std::filesystem::path& loom);
/// NotFound: the bake left none. DataLoss: they are not what was written.
absl::StatusOr<std::vector<uint8_t>> read_traces(const std::filesystem::path& loom, const Manifest& manifest);

/// Reads every chunk and checks that manifest and chunks agree: digests, counts, sizes, orders, object identities.
/// The error names the first chunk at fault.
absl::Status verify_asset(const std::filesystem::path& loom);

}  // namespace lightloom
