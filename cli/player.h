// The runtime as the command line uses it: an asset on disk, lit by arrays of surface light.
#pragma once

#include <filesystem>
#include <vector>

#include "core/base/status.h"
#include "core/relight/surface_inputs.h"

namespace lightloom {

/// What computes E.
enum class Player {
  kVulkan,  ///< the runtime on a Vulkan device
  kSimd,    ///< the runtime without a device, on the processor's vector units
  kDecoder  ///< the reference decoder, in double precision
};

struct PlayOptions {
  int iterations = 1;  ///< frames; each adds a bounce
  Player player = Player::kVulkan;
  bool validation = false;  ///< with kVulkan: its validation layers; any message is an error
  int threads = 0;          ///< of kSimd; 0: one per hardware thread
};

/// Milliseconds of the runtime's passes, summed over the frames; 0 for the decoder.
struct PlayTimes {
  double radiosity = 0, relight = 0, project = 0, receive = 0;
};

/// E per surface element after `iterations` frames from darkness.
absl::StatusOr<std::vector<Vec3>> play(const std::filesystem::path& loom, const SurfaceInputs& inputs, Vec3 environment,
                                       const PlayOptions& options, PlayTimes* times = nullptr);

}  // namespace lightloom
