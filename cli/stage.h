// A lit level that pictures are taken of: drawn by Vulkan, or ray cast on the processor.
#pragma once

#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "cli/level.h"
#include "cli/player.h"
#include "cli/progress.h"
#include "core/relight/surface_inputs.h"
#include "core/scene/picture.h"

namespace lightloom {

/// Where the direct light that bounces comes from. What is seen directly comes from shadow maps with Vulkan, from rays
/// on the CPU.
enum class DirectSource {
  kShadowMaps,  ///< the runtime's own pass over the renderer's shadow maps; Vulkan only
  kRays         ///< traced on the CPU
};

struct StageOptions {
  std::string loom;
  int bounces = 16, direct_samples = 16, shadow_size = 0, threads = 0;
  DirectSource direct = DirectSource::kShadowMaps;
  Player player = Player::kVulkan;  ///< but kVulkan: pictures are ray cast, without a device
  bool validation = false;
};

struct PictureInfo {
  Layer layer = Layer::kFull;
  int width = 960;  ///< pixels; height = width ÷ aspect of the camera
  int samples = 4;  ///< per pixel, rounded down to a square number; 1: the pixel's centre
};

class Stage {
 public:
  /// Keeps references to `level` and `bar`. Fails if the asset was not baked from the level.
  static absl::StatusOr<std::unique_ptr<Stage>> create(const Level& level, const StageOptions& options,
                                                       ProgressBar* bar);
  Stage(const Level& level, const StageOptions& options, ProgressBar* bar)
      : level_(level), options_(options), bar_(bar) {}
  virtual ~Stage() = default;

  /// Lights the level as its lights, colours and sky are now.
  virtual absl::Status light() = 0;
  /// Of the light since light(); linear.
  virtual absl::StatusOr<Image> picture(const Camera& camera, const PictureInfo& info) = 0;
  /// E of the front sides, as lightmap_image().
  virtual absl::StatusOr<Image> lightmap() = 0;

  size_t receivers() const { return elements_.receivers.all.size(); }
  const PlayTimes& times() const { return times_; }
  double seconds() const { return seconds_; }  ///< that the runtime has taken

 protected:
  const Level& level_;
  StageOptions options_;
  ProgressBar* bar_;
  SurfaceElements elements_;
  PlayTimes times_;
  double seconds_ = 0;
};

}  // namespace lightloom
