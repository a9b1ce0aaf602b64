#include "runtime/vulkan/frame_memory.h"

#include <cstring>

namespace lightloom {
namespace {

/// A multiple of every alignment of storage buffers and memory atoms that Vulkan allows.
constexpr uint64_t kAlignment = 256;
uint64_t aligned(uint64_t at) { return (at + kAlignment - 1) / kAlignment * kAlignment; }
/// The counters come first in Control.
constexpr uint64_t kCounterBytes = offsetof(gpu::Control, limit);

}  // namespace

absl::StatusOr<std::unique_ptr<FrameMemory>> FrameMemory::create(Context* context, uint64_t staging_bytes,
                                                                 uint32_t max_lights, uint32_t max_views) {
  std::unique_ptr<FrameMemory> memory(new FrameMemory(context, max_lights, max_views));
  memory->staging_bytes_ = aligned(staging_bytes);
  memory->lights_at_ = memory->staging_bytes_;
  memory->views_at_ = aligned(memory->lights_at_ + max_lights * sizeof(gpu::Light));
  memory->control_at_ = aligned(memory->views_at_ + max_views * sizeof(gpu::ShadowView));
  memory->frame_bytes_ = aligned(memory->control_at_ + kCounterBytes);
  LL_ASSIGN_OR_RETURN(memory->buffer_,
                      Buffer::create(context, memory->frame_bytes_ * context->frames, BufferUse::kHost));
  if (context->timestamp_bits > 0) {
    auto info = vulkan_struct<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
    info.queryType = VK_QUERY_TYPE_TIMESTAMP;
    info.queryCount = context->frames * kSteps;
    LL_VK_RETURN_IF_ERROR("vkCreateQueryPool",
                          context->vk.CreateQueryPool(context->device, &info, context->callbacks, &memory->queries_));
  }
  return memory;
}

FrameMemory::~FrameMemory() { context_->vk.DestroyQueryPool(context_->device, queries_, context_->callbacks); }

Staging FrameMemory::staging(uint32_t frame) const { return {context_, &buffer_, start(frame), staging_bytes_}; }

VkDescriptorBufferInfo FrameMemory::lights_range(uint32_t frame) const {
  return {buffer_.handle(), start(frame) + lights_at_, max_lights_ * sizeof(gpu::Light)};
}
VkDescriptorBufferInfo FrameMemory::views_range(uint32_t frame) const {
  return {buffer_.handle(), start(frame) + views_at_, max_views_ * sizeof(gpu::ShadowView)};
}
absl::Status FrameMemory::flush_lights(uint32_t frame) const {
  return buffer_.flush(start(frame) + lights_at_, control_at_ - lights_at_);
}

void FrameMemory::read_back(VkCommandBuffer commands, uint32_t frame, const Buffer& control) {
  const VkBufferCopy copy{0, start(frame) + control_at_, kCounterBytes};
  context_->vk.CmdCopyBuffer(commands, control.handle(), buffer_.handle(), 1, &copy);
  recorded_[frame % context_->frames] = frame;
}

void FrameMemory::begin_times(VkCommandBuffer commands, uint32_t frame) {
  if (queries_ == VK_NULL_HANDLE) return;
  context_->vk.CmdResetQueryPool(commands, queries_, frame % context_->frames * kSteps, kSteps);
  time(commands, frame, Step::kStart);
}

void FrameMemory::time(VkCommandBuffer commands, uint32_t frame, Step step) const {
  if (queries_ == VK_NULL_HANDLE) return;
  context_->vk.CmdWriteTimestamp(commands, VK_PIPELINE_STAGE_BOTTOM_OF_PIPE_BIT, queries_,
                                 frame % context_->frames * kSteps + static_cast<uint32_t>(step));
}

absl::StatusOr<bool> FrameMemory::take(uint32_t frame, gpu::Control* counters, StepTimes* times) {
  uint32_t& recorded = recorded_[frame % context_->frames];
  if (frame == 0 || recorded != frame) return false;
  recorded = 0;
  const uint64_t offset = start(frame) + control_at_;
  LL_RETURN_IF_ERROR(buffer_.invalidate(offset, kCounterBytes));
  std::memcpy(counters, buffer_.mapped() + offset, kCounterBytes);
  times->fill(0);
  if (queries_ == VK_NULL_HANDLE) return true;
  std::array<uint64_t, kSteps> ticks;
  const VkResult result =
      context_->vk.GetQueryPoolResults(context_->device, queries_, frame % context_->frames * kSteps, kSteps,
                                       sizeof ticks, ticks.data(), sizeof(uint64_t), VK_QUERY_RESULT_64_BIT);
  if (result == VK_NOT_READY) return true;
  LL_VK_RETURN_IF_ERROR("vkGetQueryPoolResults", result);
  const uint64_t mask = context_->timestamp_bits >= 64 ? ~uint64_t{0} : (uint64_t{1} << context_->timestamp_bits) - 1;
  const double to_ms = static_cast<double>(context_->limits.timestampPeriod) * 1e-6;
  for (size_t s = 1; s < kSteps; ++s) {
    (*times)[s] = static_cast<double>((ticks[s] - ticks[s - 1]) & mask) * to_ms;
  }
  return true;
}

}  // namespace lightloom
