// The C API as the command line uses it: errors as absl::Status, an asset from a .loom folder.
#pragma once

#include <lightloom.h>

#include <filesystem>
#include <string>

#include "cli/player.h"

namespace lightloom {

/// What a runtime says: give `receive` and this to it. Must outlive it.
class RuntimeMessages {
 public:
  static void receive(void* user, lightloom_message_kind kind, const char* text);
  /// The result as a status, with the newest message. Anything from the validation layers is an error.
  absl::Status status(lightloom_result result) const;

 private:
  std::string newest_;
  int validation_ = 0;
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
