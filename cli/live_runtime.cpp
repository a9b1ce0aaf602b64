#include "cli/live_runtime.h"

#include <algorithm>

#include "core/base/file.h"

namespace lightloom {
namespace {

/// Of the way from one detail of a cell to another, each frame.
constexpr float kFade = 0.3f;

void store(Vec3 v, float* to) {
  to[0] = v.x;
  to[1] = v.y;
  to[2] = v.z;
}

}  // namespace

absl::StatusOr<std::unique_ptr<LiveRuntime>> LiveRuntime::create(const renderer::Gpu& gpu, const Scene& scene,
                                                                 const std::filesystem::path& loom,
                                                                 const Options& options) {
  std::unique_ptr<LiveRuntime> live(new LiveRuntime(scene, options));
  const RuntimeMessages& messages = live->messages_;
  lightloom_vulkan_create_info create{};
  create.struct_size = sizeof create;
  create.flags = options.streams ? LIGHTLOOM_CREATE_SMOOTHING : 0;
  create.message = RuntimeMessages::receive;
  create.message_user = &live->messages_;
  create.instance = gpu.instance();
  create.physical_device = gpu.physical();
  create.device = gpu.device();
  create.get_instance_proc_addr = vkGetInstanceProcAddr;
  create.queue_family = gpu.queue_family();
  create.frames_in_flight = 1;  // Gpu::run waits
  create.max_lights = std::max(1u, static_cast<uint32_t>(scene.lights.size()));
  create.max_shadow_views = std::max(1u, renderer::shadow_view_count(scene.lights));
  create.image_format = VK_FORMAT_R32G32B32A32_SFLOAT;
  lightloom_runtime* runtime = nullptr;
  LL_RETURN_IF_ERROR(messages.status(lightloom_vulkan_create(&create, &runtime)));
  live->runtime_.reset(runtime);
  if (options.streams) {
    LL_RETURN_IF_ERROR(live->set_fade());
    LL_ASSIGN_OR_RETURN(const auto manifest, read_file(loom / "manifest"));
    LL_RETURN_IF_ERROR(messages.status(lightloom_load_manifest(runtime, manifest.data(), manifest.size())));
    LL_RETURN_IF_ERROR(live->start_stream(loom));
  } else {
    LL_RETURN_IF_ERROR(load_loom(loom, messages, runtime));
  }
  live->outputs_.struct_size = sizeof live->outputs_;
  LL_RETURN_IF_ERROR(messages.status(lightloom_vulkan_get_outputs(runtime, &live->outputs_)));
  return live;
}

absl::Status LiveRuntime::set_fade() {
  lightloom_update_options options{};
  options.struct_size = sizeof options;
  options.fade = kFade;
  return messages_.status(lightloom_set_update_options(runtime_.get(), &options));
}

absl::Status LiveRuntime::start_stream(const std::filesystem::path& loom) {
  reader_ = std::make_unique<LoomReader>(loom);
  lightloom_stream_info info{};
  info.struct_size = sizeof info;
  info.read_chunk = LoomReader::read;
  info.read_user = reader_.get();
  info.byte_budget = options_.byte_budget;
  lightloom_stream* stream = nullptr;
  LL_RETURN_IF_ERROR(messages_.status(lightloom_stream_create(runtime_.get(), &info, &stream)));
  stream_.reset(stream);
  lightloom_counts counts{};
  counts.struct_size = sizeof counts;
  LL_RETURN_IF_ERROR(messages_.status(lightloom_get_counts(runtime_.get(), &counts)));
  cells_ = counts.cells;
  return absl::OkStatus();
}

absl::Status LiveRuntime::reload(const Scene& scene, const std::filesystem::path& loom,
                                 std::span<const uint8_t> manifest) {
  stream_.reset();
  LL_RETURN_IF_ERROR(messages_.status(lightloom_reload_manifest(runtime_.get(), manifest.data(), manifest.size())));
  scene_ = &scene;
  LL_RETURN_IF_ERROR(start_stream(loom));
  return messages_.status(lightloom_vulkan_get_outputs(runtime_.get(), &outputs_));
}

absl::Status LiveRuntime::look_from(Vec3 position, Vec3 velocity) {
  lightloom_stream_view view{};
  view.struct_size = sizeof view;
  store(position, view.position);
  store(velocity, view.velocity);
  return messages_.status(lightloom_stream_set_view(stream_.get(), &view));
}

bool LiveRuntime::arriving() const {
  if (stream_ == nullptr) return false;
  lightloom_stream_state state{};
  state.struct_size = sizeof state;
  lightloom_counts counts{};
  counts.struct_size = sizeof counts;
  return lightloom_stream_get_state(stream_.get(), &state) == LIGHTLOOM_OK &&
         lightloom_get_counts(runtime_.get(), &counts) == LIGHTLOOM_OK && (state.done == 0 || counts.pending_bytes > 0);
}

std::vector<uint8_t> LiveRuntime::cell_levels() const {
  std::vector<uint8_t> levels(cells_, 3);
  if (stream_ != nullptr) lightloom_stream_get_levels(stream_.get(), levels.data(), static_cast<uint32_t>(cells_));
  return levels;
}

absl::Status LiveRuntime::set_materials(const SurfaceInputs& inputs) {
  return set_albedo_emission_sky(inputs, scene_->environment, messages_, runtime_.get());
}

absl::Status LiveRuntime::set_materials(const SurfaceInputs& inputs, uint64_t first) {
  const uint64_t count = inputs.albedo.size();
  LL_RETURN_IF_ERROR(messages_.status(lightloom_set_albedo(runtime_.get(), floats(inputs.albedo), first, count)));
  return messages_.status(lightloom_set_emission(runtime_.get(), floats(inputs.emission), first, count));
}

absl::Status LiveRuntime::upload(renderer::Gpu* gpu, const std::function<absl::Status()>& goes_on) {
  lightloom_counts counts{};
  counts.struct_size = sizeof counts;
  do {
    LL_RETURN_IF_ERROR(goes_on());
    LL_RETURN_IF_ERROR(gpu->run([this](VkCommandBuffer commands) {
      return messages_.status(lightloom_vulkan_record(runtime_.get(), commands, nullptr));
    }));
    LL_RETURN_IF_ERROR(messages_.status(lightloom_get_counts(runtime_.get(), &counts)));
  } while (counts.pending_bytes > 0);
  return messages_.status(lightloom_reset_feedback(runtime_.get()));
}

absl::Status LiveRuntime::record(const renderer::Renderer& renderer, VkCommandBuffer commands) {
  const renderer::ShadowViews& shadows = renderer.shadow_views();
  std::vector<lightloom_light> lights;
  for (size_t i = 0; i < scene_->lights.size(); ++i) {
    const Light& from = scene_->lights[i];
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
  frame.shadow_maps = renderer.shadow_maps().view();
  frame.shadow_layout = renderer::kSampled.layout;
  frame.shadow_map_size = renderer.shadow_maps().size();
  return messages_.status(lightloom_vulkan_record(runtime_.get(), commands, &frame));
}

}  // namespace lightloom
