#include "cli/live_stage.h"

#include <lightloom_vulkan.h>

#include <algorithm>
#include <cstring>

#include "cli/interrupt.h"
#include "cli/loom_runtime.h"
#include "core/base/stopwatch.h"
#include "core/relight/lightmap.h"
#include "runtime/renderer/renderer.h"

namespace lightloom {
namespace {

void store(Vec3 v, float* to) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

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
    LL_ASSIGN_OR_RETURN(times_, play_times(messages_, runtime_.get()));
    return image;
  }

  absl::StatusOr<Image> lightmap() override {
    const size_t n = elements_.receivers.all.size();
    LL_ASSIGN_OR_RETURN(const renderer::Buffer host,
                        gpu_->host_buffer(outputs_.irradiance_bytes, VK_BUFFER_USAGE_TRANSFER_DST_BIT));
    LL_RETURN_IF_ERROR(gpu_->run([&](VkCommandBuffer commands) -> absl::Status {
      if (waiting_) {
        renderer_->record_shadows(commands);
        LL_RETURN_IF_ERROR(record(commands));
      }
      const VkBufferCopy all{0, 0, outputs_.irradiance_bytes};
      vkCmdCopyBuffer(commands, outputs_.irradiance, host.handle.get(), 1, &all);
      renderer::after_copies(commands);
      return absl::OkStatus();
    }));
    waiting_ = false;
    LL_ASSIGN_OR_RETURN(times_, play_times(messages_, runtime_.get()));
    std::vector<Vec3> e(n);
    std::memcpy(e.data(), host.mapped, std::min<uint64_t>(n * sizeof(Vec3), outputs_.irradiance_bytes));
    return lightmap_image(elements_, e);
  }

 private:
  absl::Status start();
  absl::Status upload();
  absl::Status record(VkCommandBuffer commands);

  // Destroyed from the last to the first: the runtime before its device.
  std::unique_ptr<renderer::Gpu> gpu_;
  std::unique_ptr<renderer::Renderer> renderer_;
  RuntimeMessages messages_;
  std::unique_ptr<lightloom_runtime, decltype(&lightloom_destroy)> runtime_{nullptr, lightloom_destroy};
  lightloom_vulkan_outputs outputs_{};
  bool waiting_ = false;
};

absl::Status LiveStage::start() {
  const Scene& scene = *level_.scene;
  LL_ASSIGN_OR_RETURN(gpu_, renderer::Gpu::create(options_.validation));
  LL_ASSIGN_OR_RETURN(renderer_, renderer::Renderer::create(gpu_.get(), scene, elements_.layout,
                                                            static_cast<uint32_t>(options_.shadow_size)));
  lightloom_vulkan_create_info create{};
  create.struct_size = sizeof create;
  create.message = RuntimeMessages::receive;
  create.message_user = &messages_;
  create.instance = gpu_->instance();
  create.physical_device = gpu_->physical();
  create.device = gpu_->device();
  create.get_instance_proc_addr = vkGetInstanceProcAddr;
  create.queue_family = gpu_->queue_family();
  create.frames_in_flight = 1;  // Gpu::run waits
  create.max_lights = std::max(1u, static_cast<uint32_t>(scene.lights.size()));
  create.max_shadow_views = std::max(1u, renderer::shadow_view_count(scene.lights));
  create.image_format = VK_FORMAT_R32G32B32A32_SFLOAT;
  lightloom_runtime* runtime = nullptr;
  LL_RETURN_IF_ERROR(messages_.status(lightloom_vulkan_create(&create, &runtime)));
  runtime_.reset(runtime);

  LL_RETURN_IF_ERROR(load_loom(options_.loom, messages_, runtime));
  LL_ASSIGN_OR_RETURN(const SurfaceInputs inputs, surface_materials(*level_.tracer, elements_, options_.direct_samples,
                                                                    bar_->parallel("materials", options_.threads)));
  bar_->finish();
  LL_RETURN_IF_ERROR(set_albedo_emission_sky(inputs, scene.environment, messages_, runtime));
  LL_RETURN_IF_ERROR(upload());
  outputs_.struct_size = sizeof outputs_;
  LL_RETURN_IF_ERROR(messages_.status(lightloom_vulkan_get_outputs(runtime, &outputs_)));
  // Before the first frame there is no E to sample: the renderer's own, dark, stands in.
  if (options_.bounces > 0) renderer_->use_irradiance(outputs_.image_view, VK_IMAGE_LAYOUT_GENERAL);
  return absl::OkStatus();
}

/// Asset and materials go to the device with the first frames, some megabytes each. A game would not wait: it would be
/// lit piece by piece. Pictures must not depend on it, so light starts from darkness once all is there.
absl::Status LiveStage::upload() {
  lightloom_counts counts{};
  counts.struct_size = sizeof counts;
  do {
    LL_RETURN_IF_ERROR(not_interrupted());
    LL_RETURN_IF_ERROR(gpu_->run([this](VkCommandBuffer commands) {
      return messages_.status(lightloom_vulkan_record(runtime_.get(), commands, nullptr));
    }));
    LL_RETURN_IF_ERROR(messages_.status(lightloom_get_counts(runtime_.get(), &counts)));
  } while (counts.pending_bytes > 0);
  return messages_.status(lightloom_reset_feedback(runtime_.get()));
}

absl::Status LiveStage::record(VkCommandBuffer commands) {
  const renderer::ShadowViews& shadows = renderer_->shadow_views();
  std::vector<lightloom_light> lights;
  for (size_t i = 0; i < level_.scene->lights.size(); ++i) {
    const Light& from = level_.scene->lights[i];
    lightloom_light& to = lights.emplace_back();
    to.type = static_cast<uint32_t>(from.type);
    to.first_shadow_view = shadows.lights[i].first_view;
    store(from.position, to.position);
    to.range = from.range;
    store(from.direction, to.direction);
    to.inner_cone = from.inner_cone_angle;
    store(from.color * from.intensity, to.intensity);
    to.outer_cone = from.outer_cone_angle;
  }
  static_assert(static_cast<uint32_t>(LightType::kPoint) == LIGHTLOOM_LIGHT_POINT &&
                static_cast<uint32_t>(LightType::kSpot) == LIGHTLOOM_LIGHT_SPOT &&
                static_cast<uint32_t>(LightType::kDirectional) == LIGHTLOOM_LIGHT_DIRECTIONAL);
  std::vector<lightloom_shadow_view> views;
  for (const renderer::gpu::ViewData& from : shadows.views) {
    lightloom_shadow_view& to = views.emplace_back();
    std::copy(from.view_projection.begin(), from.view_projection.end(), to.view_projection);
    to.layer = from.layer;
  }
  lightloom_frame_info frame{};
  frame.struct_size = sizeof frame;
  frame.direct_source = LIGHTLOOM_DIRECT_LIGHTS;
  frame.lights = lights.data();
  frame.light_count = static_cast<uint32_t>(lights.size());
  frame.shadow_views = views.data();
  frame.shadow_view_count = static_cast<uint32_t>(views.size());
  frame.shadow_maps = renderer_->shadow_maps().view();
  frame.shadow_layout = renderer::kSampled.layout;
  frame.shadow_map_size = renderer_->shadow_maps().size();
  return messages_.status(lightloom_vulkan_record(runtime_.get(), commands, &frame));
}

}  // namespace

absl::StatusOr<std::unique_ptr<Stage>> make_live_stage(const Level& level, const StageOptions& options,
                                                       ProgressBar* bar) {
  return std::make_unique<LiveStage>(level, options, bar);
}

}  // namespace lightloom
