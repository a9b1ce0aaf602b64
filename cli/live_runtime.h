// lightloom on a renderer's device, as an engine has it: one command buffer holds shadow maps, lightloom's passes over them,
// and the picture that samples E.
#pragma once

#include <lightloom_vulkan.h>

#include <filesystem>
#include <memory>

#include "cli/loom_runtime.h"
#include "core/scene/scene.h"
#include "runtime/renderer/renderer.h"

namespace lightloom {

class LiveRuntime {
 public:
  /// With the asset loaded. Keeps references to `gpu` and `scene`, of which lights may change between frames.
  static absl::StatusOr<std::unique_ptr<LiveRuntime>> create(const renderer::Gpu& gpu, const Scene& scene,
                                                             const std::filesystem::path& loom);

  absl::Status set_materials(const SurfaceInputs& inputs);
  /// Albedo and emission of the elements from `first` on; `direct` is not looked at.
  absl::Status set_materials(const SurfaceInputs& inputs, uint64_t first);

  /// Asset and materials go to the device with the first frames, some megabytes each. A game would not wait: it would be
  /// lit piece by piece. Pictures must not depend on it, so light starts from darkness once all is there. `goes_on` fails
  /// to stop it.
  absl::Status upload(renderer::Gpu* gpu, const std::function<absl::Status()>& goes_on);

  /// A frame, with the scene's lights and the shadow maps that `renderer` has of them.
  absl::Status record(const renderer::Renderer& renderer, VkCommandBuffer commands);

  const lightloom_vulkan_outputs& outputs() const { return outputs_; }
  absl::StatusOr<PlayTimes> times() const { return play_times(messages_, runtime_.get()); }

 private:
  explicit LiveRuntime(const Scene& scene) : scene_(scene) {}

  const Scene& scene_;
  RuntimeMessages messages_;
  std::unique_ptr<lightloom_runtime, decltype(&lightloom_destroy)> runtime_{nullptr, lightloom_destroy};
  lightloom_vulkan_outputs outputs_{};
};

}  // namespace lightloom
