// One frame of an asset, as commands. Nothing here allocates.
#include <algorithm>
#include <cmath>
#include <cstring>

#include "runtime/rounding.h"
#include "runtime/vulkan/asset.h"
#include "runtime/vulkan/barriers.h"

namespace lightloom {
namespace {

constexpr uint32_t kNoSky = 0xffffffffu;
constexpr double kPiD = 3.14159265358979323846;

uint32_t or_all(uint32_t limit) { return limit == 0 ? UINT32_MAX : limit; }

gpu::Light gpu_light(const lightloom_light& l) {
  gpu::Light g{};
  std::copy(l.position, l.position + 3, g.position);
  std::copy(l.direction, l.direction + 3, g.direction);
  std::copy(l.intensity, l.intensity + 3, g.intensity);
  g.type = l.type;
  g.first_view = l.first_shadow_view;
  g.range = l.range;
  // Cone falloff as KHR_lights_punctual recommends.
  const float cos_outer = std::cos(l.outer_cone), cos_inner = std::cos(l.inner_cone);
  g.cone_scale = 1.0f / std::max(0.001f, cos_inner - cos_outer);
  g.cone_offset = -cos_outer * g.cone_scale;
  return g;
}

absl::Status check_lights(const lightloom_frame_info& info, const FrameMemory& memory) {
  if (info.light_count > memory.max_lights() || info.shadow_view_count > memory.max_views()) {
    return absl::InvalidArgumentError("frame has " + std::to_string(info.light_count) + " lights and " +
                                      std::to_string(info.shadow_view_count) +
                                      " shadow views; create with larger max_lights, max_shadow_views");
  }
  if ((info.light_count > 0 && info.lights == nullptr) ||
      (info.shadow_view_count > 0 &&
       (info.shadow_views == nullptr || info.shadow_maps == VK_NULL_HANDLE || info.shadow_map_size == 0))) {
    return absl::InvalidArgumentError("lightloom_frame_info has lights or shadow views but not all that they need");
  }
  for (uint32_t i = 0; i < info.light_count; ++i) {
    const lightloom_light& l = info.lights[i];
    if (l.type > LIGHTLOOM_LIGHT_DIRECTIONAL) {
      return absl::InvalidArgumentError("light " + std::to_string(i) + " is of unknown type");
    }
    const uint32_t views = l.type == LIGHTLOOM_LIGHT_POINT ? 6 : 1;
    if (l.first_shadow_view != LIGHTLOOM_NO_SHADOW && uint64_t{l.first_shadow_view} + views > info.shadow_view_count) {
      return absl::InvalidArgumentError("light " + std::to_string(i) + " has shadow views that do not exist");
    }
    const float values[] = {l.position[0],  l.position[1],  l.position[2],  l.range,
                            l.direction[0], l.direction[1], l.direction[2], l.inner_cone,
                            l.outer_cone,   l.intensity[0], l.intensity[1], l.intensity[2]};
    if (!std::all_of(std::begin(values), std::end(values), [](float v) { return std::isfinite(v); })) {
      return absl::InvalidArgumentError("light " + std::to_string(i) + " has a number that is not finite");
    }
  }
  return absl::OkStatus();
}

}  // namespace

void VulkanAsset::dispatch_indirect(VkCommandBuffer commands, size_t offset) const {
  context_->vk.CmdDispatchIndirect(commands, control_.handle(), offset);
}

/// Frees what no frame in flight uses any more.
void VulkanAsset::free_graves(uint32_t frame) {
  auto g = graves_.begin();
  for (; g != graves_.end() && g->frame <= frame; ++g) {
    if (g->slot) {
      relight_pools_->release(*g->slot, frame);
    } else {
      cell_pools_->release(g->place, frame);
    }
  }
  graves_.erase(graves_.begin(), g);
  if (inherited_until_ != 0 && inherited_until_ <= frame) inherited_ = Buffer();
  relight_pools_->free_retired(frame);
  cell_pools_->free_retired(frame);
}

bool VulkanAsset::nothing_to_do(const lightloom_frame_info& info, uint32_t frame) {
  const VkDescriptorBufferInfo source =
      info.direct_source == LIGHTLOOM_DIRECT_BUFFER
          ? VkDescriptorBufferInfo{info.direct_buffer, info.direct_offset, 12ull * index_.surface_elements()}
          : inputs_[0].device().whole();
  const bool same_source = source.buffer == direct_source_.buffer && source.offset == direct_source_.offset;
  direct_source_ = source;
  // What a buffer or shadow maps hold may have changed unseen.
  if (touched_ || tables_pending() || !uploads_.empty() || !same_source || smooth_ || image_stale_ ||
      settings_.options.smoothing < 1 || info.direct_source != LIGHTLOOM_DIRECT_HOST) {
    touched_ = false;
    quiet_ = false;
    touched_frame_ = frame;
  }
  return quiet_;
}

absl::Status VulkanAsset::record(VkCommandBuffer commands, const lightloom_frame_info& info, uint32_t frame,
                                 FrameKind kind, FrameMemory* memory) {
  const std::lock_guard lock(mutex_);
  if (info.direct_source == LIGHTLOOM_DIRECT_LIGHTS) LL_RETURN_IF_ERROR(check_lights(info, *memory));
  if (info.direct_source == LIGHTLOOM_DIRECT_BUFFER &&
      (info.direct_buffer == VK_NULL_HANDLE ||
       info.direct_offset % context_->limits.minStorageBufferOffsetAlignment != 0)) {
    return absl::InvalidArgumentError("direct_buffer is null or direct_offset is not aligned");
  }
  if (!(info.image_exposure >= 0) || !std::isfinite(info.image_exposure)) {
    return absl::InvalidArgumentError("image_exposure must be finite and positive, or 0, which stands for 1");
  }
  const float exposure = info.image_exposure > 0 ? info.image_exposure : 1;
  if (kind == FrameKind::kWhole && exposure != exposure_) {
    exposure_ = exposure;
    image_stale_ = true;
  }
  recorded_ = frame;
  chunk_bytes_ = 0;
  free_graves(frame);
  if (kind == FrameKind::kUploads) {
    barrier_before(*context_, commands);
    LL_RETURN_IF_ERROR(record_uploads(commands, frame, memory));
    barrier_after(*context_, commands);
    touch();
    return absl::OkStatus();
  }
  if (nothing_to_do(info, frame)) {
    skipped_frame_ = frame;
    return absl::OkStatus();
  }
  memory->begin_times(commands, frame);
  barrier_before(*context_, commands);
  LL_RETURN_IF_ERROR(record_uploads(commands, frame, memory));
  barrier_between(*context_, commands);
  memory->time(commands, frame, Step::kUpload);
  LL_RETURN_IF_ERROR(record_direct(commands, info, frame, memory));
  memory->time(commands, frame, Step::kDirect);
  record_radiosity(commands, frame);
  barrier_between(*context_, commands);
  memory->time(commands, frame, Step::kRadiosity);
  record_select_and_relight(commands, frame, memory);
  record_cells(commands, frame, memory);
  memory->time(commands, frame, Step::kReceive);
  memory->read_back(commands, frame, control_);
  record_image(commands);
  barrier_after(*context_, commands);
  memory->time(commands, frame, Step::kImage);
  return absl::OkStatus();
}

void VulkanAsset::record_clears(VkCommandBuffer commands) {
  const VulkanTable& vk = context_->vk;
  for (const ShadowTable& t : inputs_) t.clear(commands, *context_);
  cell_table_.clear(commands, *context_);
  slot_table_.clear(commands, *context_);
  map_table_.clear(commands, *context_);
  near_table_.clear(commands, *context_);
  for (const Buffer* b : {&irradiance_, &radiosity_, &points_, &normals_, &lambda_, &dirty_, &slot_seen_, &stamps_,
                          &cell_dirty_, &cell_seen_, &control_}) {
    if (b->exists()) vk.CmdFillBuffer(commands, b->handle(), 0, VK_WHOLE_SIZE, 0);
  }
  if (map_ != nullptr) {
    auto barrier = vulkan_struct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
    barrier.dstAccessMask = VK_ACCESS_SHADER_WRITE_BIT;
    barrier.newLayout = VK_IMAGE_LAYOUT_GENERAL;
    barrier.srcQueueFamilyIndex = barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
    barrier.image = image_.handle();
    barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, kImageLayers};
    vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TOP_OF_PIPE_BIT, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, 0, 0,
                          nullptr, 0, nullptr, 1, &barrier);
  }
  barrier_between(*context_, commands);
}

absl::Status VulkanAsset::record_uploads(VkCommandBuffer commands, uint32_t frame, FrameMemory* memory) {
  const VulkanTable& vk = context_->vk;
  if (!cleared_) record_clears(commands);
  cleared_ = true;
  if (inherited_.exists() && inherited_until_ == 0) {
    if (!inherited_parts_.empty()) {
      vk.CmdCopyBuffer(commands, inherited_.handle(), irradiance_.handle(),
                       static_cast<uint32_t>(inherited_parts_.size()), inherited_parts_.data());
      // Cells fade from that light to their own.
      vk.CmdFillBuffer(commands, cell_seen_.handle(), 0, VK_WHOLE_SIZE, UINT32_MAX);
    }
    inherited_until_ = frame + context_->frames;
  }
  if (reset_) {
    for (const Buffer* b : {&irradiance_, &cell_seen_}) vk.CmdFillBuffer(commands, b->handle(), 0, VK_WHOLE_SIZE, 0);
    reset_ = false;
    image_stale_ = true;
  }
  // All but the cursors.
  vk.CmdFillBuffer(commands, control_.handle(), 16, sizeof(gpu::Control) - 16, 0);
  vk.CmdFillBuffer(commands, changed_.handle(), 0, VK_WHOLE_SIZE, 0);

  // Inputs first, but never so much of them that chunks starve, nor so many chunks that tables do.
  Staging staging = memory->staging(frame);
  const uint64_t all = staging.room();
  for (ShadowTable& t : inputs_) t.record(commands, &staging, staging.room() - std::min(staging.room(), all / 4));
  const uint64_t limit = settings_.options.upload_bytes == 0 ? UINT64_MAX : settings_.options.upload_bytes;
  const uint64_t chunks = std::min(staging.room() - staging.room() / 4, limit);
  const uint64_t before = staging.used();
  uploads_.record(commands, *context_, &staging, chunks, [this](AssetIndex::Target t) { uploaded(t); });
  chunk_bytes_ = staging.used() - before;
  slot_table_.record(commands, &staging, staging.room());
  // A cell is live once it is known what else its light depends on.
  near_table_.record(commands, &staging, staging.room());
  if (near_table_.pending_bytes() == 0) cell_table_.record(commands, &staging, staging.room());
  map_table_.record(commands, &staging, staging.room());
  if (!smooth_ && options_.smoothing && (settings_.options.smoothing < 1 || fade_left_ > 0)) {
    barrier_between(*context_, commands);
    const uint64_t bytes = irradiance_.size() / 2;
    const VkBufferCopy copy{0, bytes, bytes};
    vk.CmdCopyBuffer(commands, irradiance_.handle(), irradiance_.handle(), 1, &copy);
    smooth_ = true;
  }
  // What cells and slots have left may still be read by frames whose tables say so.
  if (cell_table_.pending_bytes() + slot_table_.pending_bytes() > 0) {
    for (Grave& g : graves_) g.frame = std::max(g.frame, frame + context_->frames + 1);
  }
  return staging.flush();
}

absl::Status VulkanAsset::record_direct(VkCommandBuffer commands, const lightloom_frame_info& info, uint32_t frame,
                                        FrameMemory* memory) {
  const uint32_t S = index_.surface_elements();
  if (info.direct_source != LIGHTLOOM_DIRECT_LIGHTS || S == 0) return absl::OkStatus();
  for (uint32_t i = 0; i < info.light_count; ++i) memory->lights(frame)[i] = gpu_light(info.lights[i]);
  for (uint32_t i = 0; i < info.shadow_view_count; ++i) {
    gpu::ShadowView& view = memory->views(frame)[i];
    std::copy(info.shadow_views[i].view_projection, info.shadow_views[i].view_projection + 16, view.columns);
    view.layer = info.shadow_views[i].layer;
  }
  LL_RETURN_IF_ERROR(memory->flush_lights(frame));
  const bool shadowed = info.shadow_view_count > 0;
  const Pass pass = shadowed ? Pass::kDirectShadowed : Pass::kDirect;
  const VkDescriptorSet set = (shadowed ? shadowed_sets_ : direct_sets_)[frame % context_->frames];
  const VkDescriptorBufferInfo buffers[] = {points_.whole(), normals_.whole(), memory->lights_range(frame),
                                            memory->views_range(frame), inputs_[0].device().whole()};
  const VkDescriptorImageInfo maps{pipelines_->sampler(), info.shadow_maps, info.shadow_layout};
  sets_->write(set, pass, buffers, shadowed ? &maps : nullptr);
  const gpu::DirectPush push{S, info.light_count, static_cast<float>(info.shadow_map_size)};
  pipelines_->bind(commands, pass, set, push);
  pipelines_->dispatch(commands, pipelines_->groups_of(S));
  barrier_between(*context_, commands);
  direct_overwritten_ = true;
  return absl::OkStatus();
}

void VulkanAsset::record_radiosity(VkCommandBuffer commands, uint32_t frame) {
  const uint32_t S = index_.surface_elements(), f = frame % context_->frames;
  VkDescriptorBufferInfo& bound = bound_direct_[f];
  if (bound.buffer != direct_source_.buffer || bound.offset != direct_source_.offset) {
    bound = direct_source_;
    const VkDescriptorBufferInfo buffers[] = {bound,
                                              inputs_[1].device().whole(),
                                              inputs_[2].device().whole(),
                                              irradiance_.whole(),
                                              radiosity_.whole(),
                                              changed_.whole(),
                                              control_.whole()};
    sets_->write(radiosity_sets_[f], Pass::kRadiosity, buffers);
  }
  gpu::RadiosityPush push{};
  push.elements = S;
  push.epsilon = std::max(settings_.options.epsilon, kRounding);
  push.floor = settings_.options.epsilon_floor;
  push.tile_shift = tile_shift_;
  push.sky_tile = sky_changed_ ? sky_tile_ : kNoSky;
  const uint32_t slots = std::min(relight_pools_->slots(), relight_pools_->pool_slots());
  push.mark_x = std::min(slots, context_->max_groups);
  push.mark_y = slots == 0 ? 0 : (slots + push.mark_x - 1) / push.mark_x;
  push.sky_r = settings_.environment.x;
  push.sky_g = settings_.environment.y;
  push.sky_b = settings_.environment.z;
  sky_changed_ = false;
  pipelines_->bind(commands, Pass::kRadiosity, radiosity_sets_[f], push);
  pipelines_->dispatch(commands, std::max<uint64_t>(1, pipelines_->groups_of(S)));
}

void VulkanAsset::record_select_and_relight(VkCommandBuffer commands, uint32_t frame, FrameMemory* memory) {
  const auto pools = relight_pools_->pools();
  for (uint32_t p = 0; p < pools.size(); ++p) {
    if (!pools[p].in_use()) continue;
    const gpu::MarkPush push{p * relight_pools_->pool_slots(), pools[p].slots,
                             static_cast<uint32_t>(pools[p].slot_bytes / 4), relight_pools_->rays(pools[p].kind),
                             tile_words_};
    pipelines_->bind(commands, Pass::kMark, pools[p].mark, push);
    dispatch_indirect(commands, offsetof(gpu::Control, mark));
  }
  barrier_between(*context_, commands);
  const gpu::SelectProbesPush select{relight_pools_->slots(),
                                     relight_pools_->pool_slots(),
                                     or_all(settings_.options.max_probes),
                                     frame,
                                     static_cast<uint32_t>(pipelines_->groups_of(cells_.size())),
                                     context_->max_groups,
                                     relight_pools_->coarse_pool()};
  pipelines_->bind(commands, Pass::kSelectProbes, select_probes_, select);
  pipelines_->dispatch(commands, 1);
  barrier_between(*context_, commands);
  memory->time(commands, frame, Step::kSelect);

  for (uint32_t p = 0; p < pools.size(); ++p) {
    if (!pools[p].in_use()) continue;
    const uint32_t rays = relight_pools_->rays(pools[p].kind);
    const gpu::RelightPush push{settings_.environment.x,
                                settings_.environment.y,
                                settings_.environment.z,
                                static_cast<float>(4 * kPiD / rays),
                                rays,
                                stride_ / 8,
                                p * relight_pools_->pool_slots(),
                                static_cast<uint32_t>(pools[p].slot_bytes / 4),
                                p};
    pipelines_->bind(commands, Pass::kRelight, pools[p].relight, push);
    dispatch_indirect(commands, offsetof(gpu::Control, relight) + p * sizeof(gpu::Groups));
  }
  memory->time(commands, frame, Step::kRelight);
  const gpu::MarkCellsPush mark{static_cast<uint32_t>(cells_.size()), frame, tile_words_};
  pipelines_->bind(commands, Pass::kMarkCells, mark_cells_, mark);
  dispatch_indirect(commands, offsetof(gpu::Control, mark_cells));
  barrier_between(*context_, commands);
}

void VulkanAsset::record_cells(VkCommandBuffer commands, uint32_t frame, FrameMemory* memory) {
  const uint64_t texels = map_ == nullptr ? 0 : uint64_t{map_layers_} * index_.width() * index_.height();
  const gpu::SelectCellsPush select{static_cast<uint32_t>(cells_.size()), or_all(settings_.options.max_cells),
                                    static_cast<uint32_t>(pipelines_->groups_of(texels)), context_->max_groups};
  pipelines_->bind(commands, Pass::kSelectCells, select_cells_, select);
  pipelines_->dispatch(commands, 1);
  barrier_between(*context_, commands);
  memory->time(commands, frame, Step::kSelectCells);
  const auto pools = cell_pools_->pools();
  for (uint32_t p = 0; p < pools.size(); ++p) {
    if (!pools[p].in_use()) continue;
    pipelines_->bind(commands, Pass::kProject, pools[p].project, gpu::ProjectPush{stride_ / 8, p});
    dispatch_indirect(commands, offsetof(gpu::Control, project) + p * sizeof(gpu::Groups));
  }
  barrier_between(*context_, commands);
  memory->time(commands, frame, Step::kProject);
  gpu::ReceivePush push{0, smooth_ ? 3 * index_.surface_elements() : 0, settings_.options.smoothing < 1 ? 1u : 0u};
  for (uint32_t p = 0; p < pools.size(); ++p) {
    if (!pools[p].in_use()) continue;
    push.pool = p;
    pipelines_->bind(commands, Pass::kReceive, pools[p].receive, push);
    dispatch_indirect(commands, offsetof(gpu::Control, receive) + p * sizeof(gpu::Groups));
  }
  barrier_between(*context_, commands);
  if (smooth_) record_settle(commands, settle_share());
}

/// How far E goes to its target in this frame.
float VulkanAsset::settle_share() const {
  if (settings_.options.smoothing < 1) return settings_.options.smoothing;
  return fade_left_ > double{kArrived} ? settings_.options.fade : 1;
}

void VulkanAsset::record_settle(VkCommandBuffer commands, float share) {
  const uint32_t values = 3 * index_.surface_elements();
  if (values > 0) {
    pipelines_->bind(commands, Pass::kSettle, settle_, gpu::SettlePush{values, values, share, kArrived, kArrivedBlack});
    pipelines_->dispatch(commands, pipelines_->groups_of(values));
    barrier_between(*context_, commands);
  }
  image_stale_ = true;
  // Cells that wait for their turn, or for a probe's, have not begun to fade.
  if (last_.waiting_cells == 0 && last_.waiting_probes == 0) fade_left_ *= 1 - static_cast<double>(share);
  // With a share of 1 it has arrived.
  if (share >= 1) smooth_ = false;
}

void VulkanAsset::record_image(VkCommandBuffer commands) {
  if (map_ == nullptr) {
    image_stale_ = false;
    return;
  }
  const Pass pass = options_.image_format == VK_FORMAT_R32G32B32A32_SFLOAT ? Pass::kImage32 : Pass::kImage16;
  const uint32_t layers = image_stale_ ? kImageLayers : map_layers_;
  pipelines_->bind(commands, pass, image_set_, gpu::ImagePush{index_.width(), index_.height(), layers, exposure_});
  if (image_stale_) {
    pipelines_->dispatch(commands, pipelines_->groups_of(uint64_t{layers} * index_.width() * index_.height()));
    image_stale_ = map_table_.pending_bytes() > 0;
  } else {
    dispatch_indirect(commands, offsetof(gpu::Control, image));
  }
}

}  // namespace lightloom
