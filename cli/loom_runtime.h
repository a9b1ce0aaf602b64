// The C API as the command line uses it: errors as absl::Status, an asset from a .loom folder.
#pragma once

#include <lightloom.h>

#include <filesystem>
#include <mutex>
#include <string>

#include "cli/player.h"
#include "core/asset/asset.h"

namespace lightloom {

/// What a runtime says: give `receive` and this to it. Must outlive it. Any thread.
class RuntimeMessages {
 public:
  static void receive(void* user, lightloom_message_kind kind, const char* text);
  /// The result as a status, with the newest message. Anything from the validation layers is an error.
  absl::Status status(lightloom_result result) const;

 private:
  mutable std::mutex mutex_;
  std::string newest_;
  int validation_ = 0;
};

/// Chunks of an asset on disk: `read` with this as its user is a lightloom_read_chunk_fn, for one thread at a time.
class LoomReader {
 public:
  explicit LoomReader(const std::filesystem::path& loom) : store_(chunk_store(loom)) {}
  static int read(void* user, const uint8_t digest[32], uint64_t size, void* out);
  const absl::Status& status() const { return status_; }  ///< of the newest chunk

 private:
  ChunkStore store_;
  absl::Status status_;
};

/// The manifest and every chunk.
absl::Status load_loom(const std::filesystem::path& loom, const RuntimeMessages& messages, lightloom_runtime* runtime);
absl::Status set_albedo_emission_sky(const SurfaceInputs& inputs, Vec3 environment, const RuntimeMessages& messages,
                                     lightloom_runtime* runtime);
/// Of all frames since the asset was loaded.
absl::StatusOr<PlayTimes> play_times(const RuntimeMessages& messages, lightloom_runtime* runtime);

/// Packed RGB.
inline const float* floats(const std::vector<Vec3>& v) { return reinterpret_cast<const float*>(v.data()); }

}  // namespace lightloom
