#include "cli/stage.h"

#include "cli/interrupt.h"
#include "cli/live_stage.h"
#include "core/asset/asset.h"
#include "core/base/stopwatch.h"
#include "core/relight/camera_view.h"
#include "core/relight/lightmap.h"
#include "runtime/renderer/renderer.h"

namespace lightloom {
namespace {

/// Direct light of the surfaces by rays on the CPU; E by the runtime, or its reference decoder.
class PlayedStage : public Stage {
 public:
  using Stage::Stage;

  absl::Status light() override {
    LL_ASSIGN_OR_RETURN(const SurfaceInputs inputs, light_surfaces(*level_.tracer, elements_, options_.direct_samples,
                                                                   bar_->parallel("direct light", options_.threads)));
    bar_->finish();
    LL_RETURN_IF_ERROR(not_interrupted());
    const Stopwatch watch;
    PlayTimes times;
    const PlayOptions play_options{options_.bounces, options_.player, options_.validation, options_.threads};
    LL_ASSIGN_OR_RETURN(e_, play(options_.loom, inputs, level_.scene->environment, play_options, &times));
    seconds_ += watch.seconds();
    times_.radiosity += times.radiosity;
    times_.relight += times.relight;
    times_.project += times.project;
    times_.receive += times.receive;
    return lit();
  }

  absl::StatusOr<Image> lightmap() override { return lightmap_image(elements_, e_); }

 protected:
  virtual absl::Status lit() { return absl::OkStatus(); }

  std::vector<Vec3> e_;
};

/// Without a Vulkan device: slow, and what the other is checked against.
class RayCastStage : public PlayedStage {
 public:
  using PlayedStage::PlayedStage;

  absl::StatusOr<Image> picture(const Camera& camera, const PictureInfo& info) override {
    ViewOptions view;
    view.width = info.width;
    view.samples = info.samples;
    view.layer = info.layer;
    view.parallel = bar_->parallel("picture", options_.threads);
    auto image = render_view(*level_.tracer, elements_, e_, camera, view);
    bar_->finish();
    return image;
  }
};

class VulkanStage : public PlayedStage {
 public:
  using PlayedStage::PlayedStage;

  absl::StatusOr<Image> picture(const Camera& camera, const PictureInfo& info) override {
    if (!renderer_) {
      LL_ASSIGN_OR_RETURN(gpu_, renderer::Gpu::create(options_.validation));
      LL_ASSIGN_OR_RETURN(renderer_, renderer::Renderer::create(gpu_.get(), *level_.scene, elements_.layout,
                                                                static_cast<uint32_t>(options_.shadow_size)));
      LL_RETURN_IF_ERROR(lit());
    }
    return renderer_->render(camera, {info.width, info.samples, info.layer});
  }

 protected:
  absl::Status lit() override {
    if (!renderer_) return absl::OkStatus();
    return renderer_->set_irradiance(lightmap_image(elements_, e_), lightmap_image(elements_, e_, true));
  }

 private:
  std::unique_ptr<renderer::Gpu> gpu_;  // made when the first picture is taken: a lightmap needs none
  std::unique_ptr<renderer::Renderer> renderer_;
};

}  // namespace

absl::StatusOr<std::unique_ptr<Stage>> Stage::create(const Level& level, const StageOptions& options,
                                                     ProgressBar* bar) {
  LL_ASSIGN_OR_RETURN(const Manifest manifest, read_manifest(options.loom));
  std::unique_ptr<Stage> stage;
  if (options.player != Player::kVulkan) {
    stage = std::make_unique<RayCastStage>(level, options, bar);
  } else if (options.direct == DirectSource::kRays) {
    stage = std::make_unique<VulkanStage>(level, options, bar);
  } else {
    LL_ASSIGN_OR_RETURN(stage, make_live_stage(level, options, bar));
  }
  LL_ASSIGN_OR_RETURN(stage->elements_, load_surface_elements(options.loom, manifest, *level.scene));
  return stage;
}

}  // namespace lightloom
