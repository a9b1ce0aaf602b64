#include "runtime/vulkan/own_queue.h"

namespace lightloom {

absl::StatusOr<std::unique_ptr<OwnQueue>> OwnQueue::create(Context* context, VkQueue queue, uint32_t family) {
  std::unique_ptr<OwnQueue> own(new OwnQueue(context, queue));
  const VulkanTable& vk = context->vk;
  auto pool = vulkan_struct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool.queueFamilyIndex = family;
  LL_VK_RETURN_IF_ERROR("vkCreateCommandPool",
                        vk.CreateCommandPool(context->device, &pool, context->callbacks, &own->pool_));
  auto buffer = vulkan_struct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
  buffer.commandPool = own->pool_;
  buffer.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  buffer.commandBufferCount = 1;
  LL_VK_RETURN_IF_ERROR("vkAllocateCommandBuffers",
                        vk.AllocateCommandBuffers(context->device, &buffer, &own->commands_));
  const auto fence = vulkan_struct<VkFenceCreateInfo>(VK_STRUCTURE_TYPE_FENCE_CREATE_INFO);
  LL_VK_RETURN_IF_ERROR("vkCreateFence", vk.CreateFence(context->device, &fence, context->callbacks, &own->fence_));
  return own;
}

OwnQueue::~OwnQueue() {
  context_->vk.DestroyFence(context_->device, fence_, context_->callbacks);
  context_->vk.DestroyCommandPool(context_->device, pool_, context_->callbacks);
}

absl::Status OwnQueue::begin() {
  auto info = vulkan_struct<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  info.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  return vulkan_status(context_->vk.BeginCommandBuffer(commands_, &info), "vkBeginCommandBuffer");
}

absl::Status OwnQueue::submit_and_wait() {
  const VulkanTable& vk = context_->vk;
  LL_VK_RETURN_IF_ERROR("vkEndCommandBuffer", vk.EndCommandBuffer(commands_));
  auto submit = vulkan_struct<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands_;
  LL_VK_RETURN_IF_ERROR("vkQueueSubmit", vk.QueueSubmit(queue_, 1, &submit, fence_));
  LL_VK_RETURN_IF_ERROR("vkWaitForFences", vk.WaitForFences(context_->device, 1, &fence_, VK_TRUE, UINT64_MAX));
  LL_VK_RETURN_IF_ERROR("vkResetFences", vk.ResetFences(context_->device, 1, &fence_));
  return absl::OkStatus();
}

}  // namespace lightloom
