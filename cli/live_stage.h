// The level as an engine lights it: renderer and lightloom share a device and a command buffer. Direct light, on screen
// and bounced, comes from shadow maps.
#pragma once

#include <memory>

#include "cli/stage.h"

namespace lightloom {

/// For Stage::create, which completes it.
absl::StatusOr<std::unique_ptr<Stage>> make_live_stage(const Level& level, const StageOptions& options,
                                                       ProgressBar* bar);

}  // namespace lightloom
