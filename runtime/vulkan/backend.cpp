#include "runtime/vulkan/backend.h"

#include <algorithm>
#include <cstring>

#include "runtime/vulkan/barriers.h"

namespace lightloom {
namespace {

constexpr uint64_t kDefaultPageBytes = 64ull << 20;
constexpr uint64_t kDefaultStagingBytes = 8ull << 20;
constexpr uint64_t kLeastStagingBytes = 4096;
/// Invocations of a workgroup on a processor: its vector's.
constexpr uint32_t kCpuGroup = 8;

}  // namespace

absl::StatusOr<std::unique_ptr<VulkanBackend>> VulkanBackend::create(const lightloom_vulkan_create_info& info,
                                                                     std::pmr::memory_resource* memory) {
  std::unique_ptr<VulkanBackend> backend(new VulkanBackend(memory));
  Context& c = backend->context_;
  LL_RETURN_IF_ERROR(c.vk.load_instance(info.instance, info.get_instance_proc_addr));
  LL_RETURN_IF_ERROR(check_device(c.vk, info.physical_device, info.queue_family, &c.timestamp_bits));
  LL_RETURN_IF_ERROR(c.vk.load_device(info.device, info.get_device_proc_addr));
  c.physical = info.physical_device;
  c.device = info.device;
  c.callbacks = info.allocation_callbacks;
  VkPhysicalDeviceProperties properties;
  c.vk.GetPhysicalDeviceProperties(c.physical, &properties);
  c.limits = properties.limits;
  c.vk.GetPhysicalDeviceMemoryProperties(c.physical, &c.memory);
  VkFormatProperties depth;
  c.vk.GetPhysicalDeviceFormatProperties(c.physical, VK_FORMAT_D32_SFLOAT, &depth);
  c.linear_depth = (depth.optimalTilingFeatures & VK_FORMAT_FEATURE_SAMPLED_IMAGE_FILTER_LINEAR_BIT) != 0;
  // What a workgroup shares is little beside what each invocation repeats where one core runs all of them.
  const uint32_t group = properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU ? kCpuGroup : gpu::kDefaultGroup;
  c.group = info.workgroup_size == 0 ? group : info.workgroup_size;
  c.max_groups = std::min(c.limits.maxComputeWorkGroupCount[0], c.limits.maxComputeWorkGroupCount[1]);
  if (info.max_workgroups != 0) c.max_groups = std::min(c.max_groups, info.max_workgroups);
  c.frames = info.frames_in_flight;
  c.page_bytes =
      std::min<uint64_t>(info.page_bytes == 0 ? kDefaultPageBytes : info.page_bytes, c.limits.maxStorageBufferRange);
  c.budget = info.byte_budget;
  backend->asset_options_ = {(info.flags & LIGHTLOOM_CREATE_SMOOTHING) != 0, info.image_format};
  backend->options_.smoothing = backend->options_.fade = 1;

  LL_ASSIGN_OR_RETURN(backend->pipelines_, Pipelines::create(&c));
  const uint64_t staging = info.staging_bytes == 0 ? kDefaultStagingBytes : info.staging_bytes;
  LL_ASSIGN_OR_RETURN(
      backend->frame_memory_,
      FrameMemory::create(&c, std::max(staging, kLeastStagingBytes), info.max_lights == 0 ? 64 : info.max_lights,
                          info.max_shadow_views == 0 ? 128 : info.max_shadow_views));
  return backend;
}

absl::Status VulkanBackend::own(const lightloom_vulkan_device& device) {
  own_device_ = device;
  LL_ASSIGN_OR_RETURN(queue_, OwnQueue::create(&context_, device.queue, device.queue_family));
  return absl::OkStatus();
}

VulkanBackend::~VulkanBackend() {
  asset_ = nullptr;
  frame_memory_ = nullptr;
  pipelines_ = nullptr;
  queue_ = nullptr;
  lightloom_vulkan_destroy_device(&own_device_);
}

absl::Status VulkanBackend::start(std::shared_ptr<const AssetIndex> index, std::span<const AssetIndex::Kept> kept) {
  const std::unique_ptr<VulkanAsset> before = std::move(asset_);
  forget_frames();
  // Both may not fit.
  if (before != nullptr) before->free_all_but_light();
  LL_ASSIGN_OR_RETURN(auto asset,
                      VulkanAsset::create(&context_, pipelines_.get(), std::move(index), asset_options_, memory_));
  asset->set_options(options_);
  if (before != nullptr) asset->inherit(before.get(), kept);
  asset_ = std::move(asset);
  return absl::OkStatus();
}

void VulkanBackend::unload() {
  forget();
  asset_ = nullptr;
  forget_frames();
}

/// REQUIRES: all are finished.
void VulkanBackend::forget_frames() {
  frame_ = taken_ = 0;
  frame_memory_->forget();
  const std::lock_guard lock(stats_mutex_);
  stats_ = {};
}

absl::Status VulkanBackend::set_options(const lightloom_update_options& options) {
  if ((options.smoothing < 1 || options.fade < 1) && !asset_options_.smoothing) {
    return absl::InvalidArgumentError("smoothing and fade below 1 need LIGHTLOOM_CREATE_SMOOTHING");
  }
  options_ = options;
  if (asset_ != nullptr) asset_->set_options(options);
  return absl::OkStatus();
}

absl::Status VulkanBackend::record(VkCommandBuffer commands, const lightloom_frame_info& info, FrameKind kind) {
  if (frame_ >= context_.frames) LL_RETURN_IF_ERROR(take(frame_ + 1 - context_.frames));
  ++frame_;
  return asset_->record(commands, info, frame_, kind, frame_memory_.get());
}

/// Takes the results of a frame that is finished.
absl::Status VulkanBackend::take(uint32_t frame) {
  if (frame <= taken_) return absl::OkStatus();
  taken_ = frame;
  gpu::Control counters{};
  StepTimes ms;
  LL_ASSIGN_OR_RETURN(const bool recorded, frame_memory_->take(frame, &counters, &ms));
  const std::lock_guard lock(stats_mutex_);
  if (!recorded) return absl::OkStatus();
  ++stats_.frames;
  asset_->finished(frame, counters);
  const auto of = [&ms](Step step) { return ms[static_cast<size_t>(step)]; };
  stats_.upload_ms += of(Step::kUpload);
  stats_.direct_ms += of(Step::kDirect);
  stats_.radiosity_ms += of(Step::kRadiosity);
  stats_.select_ms += of(Step::kSelect) + of(Step::kSelectCells);
  stats_.relight_ms += of(Step::kRelight);
  stats_.project_ms += of(Step::kProject);
  stats_.receive_ms += of(Step::kReceive);
  stats_.image_ms += of(Step::kImage);
  return absl::OkStatus();
}

absl::Status VulkanBackend::run_frames(uint32_t frames, FrameKind kind) {
  lightloom_frame_info info{};
  LL_RETURN_IF_ERROR(queue_->run([&](VkCommandBuffer commands) -> absl::Status {
    for (uint32_t f = 0; f < frames; ++f) LL_RETURN_IF_ERROR(record(commands, info, kind));
    return absl::OkStatus();
  }));
  // All are finished.
  const uint32_t first = frame_ + 1 > context_.frames ? frame_ + 1 - context_.frames : 1;
  for (uint32_t f = first; f <= frame_; ++f) LL_RETURN_IF_ERROR(take(f));
  return absl::OkStatus();
}

absl::Status VulkanBackend::update(uint32_t frames) {
  if (queue_ == nullptr) {
    return absl::InvalidArgumentError("this runtime has no queue; record frames with lightloom_vulkan_record");
  }
  while (asset_->uploads_pending()) LL_RETURN_IF_ERROR(run_frames(1, FrameKind::kUploads));
  while (frames > 0) {
    const uint32_t now = std::min(frames, context_.frames);
    LL_RETURN_IF_ERROR(run_frames(now, FrameKind::kWhole));
    frames -= now;
  }
  return absl::OkStatus();
}

absl::Status VulkanBackend::read_irradiance(std::span<float> rgb) {
  if (queue_ == nullptr) {
    return absl::InvalidArgumentError(
        "this runtime has no queue; copy from the buffer of lightloom_vulkan_get_outputs");
  }
  const Buffer& host = frame_memory_->buffer();
  if (frame_ == 0) {
    std::fill(rgb.begin(), rgb.end(), 0.0f);
    return absl::OkStatus();
  }
  auto* const out = reinterpret_cast<uint8_t*>(rgb.data());
  for (uint64_t at = 0; at < rgb.size_bytes(); at += host.size()) {
    const uint64_t bytes = std::min<uint64_t>(host.size(), rgb.size_bytes() - at);
    LL_RETURN_IF_ERROR(queue_->run([&](VkCommandBuffer commands) -> absl::Status {
      barrier_before(context_, commands);
      const VkBufferCopy copy{at, 0, bytes};
      context_.vk.CmdCopyBuffer(commands, asset_->irradiance().handle(), host.handle(), 1, &copy);
      barrier_after(context_, commands);
      return absl::OkStatus();
    }));
    LL_RETURN_IF_ERROR(host.invalidate(0, bytes));
    std::memcpy(out + at, host.mapped(), bytes);
  }
  return absl::OkStatus();
}

lightloom_counts VulkanBackend::counts() const {
  lightloom_counts counts{};
  asset_->fill_counts(&counts);
  return counts;
}

lightloom_stats VulkanBackend::stats() const {
  lightloom_stats stats;
  {
    const std::lock_guard lock(stats_mutex_);
    stats = stats_;
  }
  stats.timestamps = context_.timestamp_bits > 0;
  asset_->fill_stats(&stats);
  return stats;
}

}  // namespace lightloom
