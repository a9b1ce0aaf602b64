#include "cli/live_stage.h"

#include <algorithm>
#include <cstring>

#include "cli/interrupt.h"
#include "cli/live_runtime.h"
#include "core/base/stopwatch.h"
#include "core/relight/lightmap.h"
#include "runtime/renderer/renderer.h"

namespace lightloom {
namespace {

class LiveStage : public Stage {
 public:
  using Stage::Stage;

  absl::Status light() override {
    if (!renderer_) LL_RETURN_IF_ERROR(start());
    LL_RETURN_IF_ERROR(renderer_->update_lights());
    const Stopwatch watch;
    // The last frame is recorded together with the next picture.
    waiting_ = options_.bounces > 0;
    for (int i = 1; i < options_.bounces; ++i) {
      LL_RETURN_IF_ERROR(not_interrupted());
      LL_RETURN_IF_ERROR(gpu_->run([&](VkCommandBuffer commands) {
        if (i == 1) renderer_->record_shadows(commands);
        return record(commands);
      }));
    }
    seconds_ += watch.seconds();
    return absl::OkStatus();
  }

  absl::StatusOr<Image> picture(const Camera& camera, const PictureInfo& info) override {
    auto image = renderer_->render(camera, {info.width, info.samples, info.layer}, [this](VkCommandBuffer commands) {
      return waiting_ ? record(commands) : absl::OkStatus();
    });
    waiting_ = false;
    LL_ASSIGN_OR_RETURN(times_, runtime_->times());
    return image;
  }

  absl::StatusOr<Image> lightmap() override {
    const size_t n = elements_.receivers.all.size();
    const uint64_t bytes = runtime_->outputs().irradiance_bytes;
    LL_ASSIGN_OR_RETURN(const renderer::Buffer host, gpu_->host_buffer(bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT));
    LL_RETURN_IF_ERROR(gpu_->run([&](VkCommandBuffer commands) -> absl::Status {
      if (waiting_) {
        renderer_->record_shadows(commands);
        LL_RETURN_IF_ERROR(record(commands));
      }
      const VkBufferCopy all{0, 0, bytes};
      vkCmdCopyBuffer(commands, runtime_->outputs().irradiance, host.handle.get(), 1, &all);
      renderer::after_copies(commands);
      return absl::OkStatus();
    }));
    waiting_ = false;
    LL_ASSIGN_OR_RETURN(times_, runtime_->times());
    std::vector<Vec3> e(n);
    std::memcpy(e.data(), host.mapped, std::min<uint64_t>(n * sizeof(Vec3), bytes));
    return lightmap_image(elements_, e);
  }

 private:
  absl::Status start();
  absl::Status record(VkCommandBuffer commands) { return runtime_->record(*renderer_, commands); }

  // Destroyed from the last to the first: the runtime before its device.
  std::unique_ptr<renderer::Gpu> gpu_;
  std::unique_ptr<renderer::Renderer> renderer_;
  std::unique_ptr<LiveRuntime> runtime_;
  bool waiting_ = false;
};

absl::Status LiveStage::start() {
  const Scene& scene = *level_.scene;
  LL_ASSIGN_OR_RETURN(gpu_, renderer::Gpu::create(options_.validation));
  LL_ASSIGN_OR_RETURN(renderer_, renderer::Renderer::create(gpu_.get(), scene, elements_.layout,
                                                            static_cast<uint32_t>(options_.shadow_size)));
  LL_ASSIGN_OR_RETURN(runtime_, LiveRuntime::create(*gpu_, scene, options_.loom, {}));
  LL_ASSIGN_OR_RETURN(const SurfaceInputs inputs, surface_materials(*level_.tracer, elements_, options_.direct_samples,
                                                                    bar_->parallel("materials", options_.threads)));
  bar_->finish();
  LL_RETURN_IF_ERROR(runtime_->set_materials(inputs));
  LL_RETURN_IF_ERROR(runtime_->upload(gpu_.get(), not_interrupted));
  // Before the first frame there is no E to sample: the renderer's own, dark, stands in.
  if (options_.bounces > 0) renderer_->use_irradiance(runtime_->outputs().image_view, VK_IMAGE_LAYOUT_GENERAL);
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::unique_ptr<Stage>> make_live_stage(const Level& level, const StageOptions& options,
                                                       ProgressBar* bar) {
  return std::make_unique<LiveStage>(level, options, bar);
}

}  // namespace lightloom
