// lightloom on a renderer's device, as an engine has it: one command buffer holds shadow maps, lightloom's passes over them,
// and the picture that samples E.
#pragma once

#include <lightloom_vulkan.h>

#include <filesystem>
#include <memory>
#include <span>

#include "cli/loom_runtime.h"
#include "core/scene/scene.h"
#include "runtime/renderer/renderer.h"

namespace lightloom {

class LiveRuntime {
 public:
  struct Options {
    bool streams = false;      ///< chunks come as look_from() needs them; else all are loaded by create()
    uint64_t byte_budget = 0;  ///< of a stream: for cells and relight sets; 0: no limit
  };
  /// With the asset loaded. Keeps references to `gpu` and `scene`, of which lights may change between frames.
  static absl::StatusOr<std::unique_ptr<LiveRuntime>> create(const renderer::Gpu& gpu, const Scene& scene,
                                                             const std::filesystem::path& loom, const Options& options);
  /// The asset was baked anew, to `manifest`, from `scene`, which has the lights of before: chunks come anew, and until then what stays of
  /// the level goes on as it was lit. Only of a runtime that streams. No frame may be running. After a failure it is of
  /// no use any more.
  absl::Status reload(const Scene& scene, const std::filesystem::path& loom, std::span<const uint8_t> manifest);

  /// Each frame of a runtime that streams.
  absl::Status look_from(Vec3 position, Vec3 velocity);
  /// Whether chunks are still on their way for the place that was looked from last.
  bool arriving() const;
  /// Per cell of the manifest, how much of it is resident: lightloom_stream_get_levels.
  std::vector<uint8_t> cell_levels() const;

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
  LiveRuntime(const Scene& scene, const Options& options) : scene_(&scene), options_(options) {}
  absl::Status start_stream(const std::filesystem::path& loom);
  absl::Status set_fade();

  const Scene* scene_;
  const Options options_;
  RuntimeMessages messages_;
  std::unique_ptr<lightloom_runtime, decltype(&lightloom_destroy)> runtime_{nullptr, lightloom_destroy};
  lightloom_vulkan_outputs outputs_{};
  std::unique_ptr<LoomReader> reader_;  ///< the stream's
  std::unique_ptr<lightloom_stream, decltype(&lightloom_stream_destroy)> stream_{nullptr, lightloom_stream_destroy};
  size_t cells_ = 0;
};

}  // namespace lightloom
