// The runtime as the command line uses it: an asset on disk, lit by arrays of surface light.
#pragma once

#include <filesystem>
#include <vector>

#include "core/base/status.h"
#include "core/relight/surface_inputs.h"

namespace lightloom {

struct PlayOptions {
  int iterations = 1;       ///< frames; each adds a bounce
  bool cpu = false;         ///< the reference decoder in place of Vulkan
  bool validation = false;  ///< Vulkan validation layers; any message is an error
};

/// Milliseconds of the Vulkan passes, summed over the frames; 0 on the CPU.
struct PlayTimes {
  double radiosity = 0, relight = 0, project = 0, receive = 0;
};

/// E per surface element after `iterations` frames from darkness.
absl::StatusOr<std::vector<Vec3>> play(const std::filesystem::path& loom, const SurfaceInputs& inputs, Vec3 environment,
                                       const PlayOptions& options, PlayTimes* times = nullptr);

}  // namespace lightloom
