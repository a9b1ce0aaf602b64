// Vulkan's functions, asked of the caller's loader: the library links to none.
#pragma once

#ifndef VK_NO_PROTOTYPES
#define VK_NO_PROTOTYPES
#endif
#include <vulkan/vulkan_core.h>

#include "core/base/status.h"

namespace lightloom {

#define LL_INSTANCE_FUNCTIONS(F)       \
  F(GetDeviceProcAddr)                 \
  F(GetPhysicalDeviceFormatProperties) \
  F(GetPhysicalDeviceMemoryProperties) \
  F(GetPhysicalDeviceProperties)       \
  F(GetPhysicalDeviceQueueFamilyProperties)

#define LL_DEVICE_FUNCTIONS(F)    \
  F(AllocateCommandBuffers)       \
  F(AllocateDescriptorSets)       \
  F(AllocateMemory)               \
  F(BeginCommandBuffer)           \
  F(BindBufferMemory)             \
  F(BindImageMemory)              \
  F(CmdBindDescriptorSets)        \
  F(CmdBindPipeline)              \
  F(CmdCopyBuffer)                \
  F(CmdDispatch)                  \
  F(CmdDispatchIndirect)          \
  F(CmdFillBuffer)                \
  F(CmdPipelineBarrier)           \
  F(CmdPushConstants)             \
  F(CmdResetQueryPool)            \
  F(CmdWriteTimestamp)            \
  F(CreateBuffer)                 \
  F(CreateCommandPool)            \
  F(CreateComputePipelines)       \
  F(CreateDescriptorPool)         \
  F(CreateDescriptorSetLayout)    \
  F(CreateFence)                  \
  F(CreateImage)                  \
  F(CreateImageView)              \
  F(CreatePipelineLayout)         \
  F(CreateQueryPool)              \
  F(CreateSampler)                \
  F(CreateShaderModule)           \
  F(DestroyBuffer)                \
  F(DestroyCommandPool)           \
  F(DestroyDescriptorPool)        \
  F(DestroyDescriptorSetLayout)   \
  F(DestroyFence)                 \
  F(DestroyImage)                 \
  F(DestroyImageView)             \
  F(DestroyPipeline)              \
  F(DestroyPipelineLayout)        \
  F(DestroyQueryPool)             \
  F(DestroySampler)               \
  F(DestroyShaderModule)          \
  F(EndCommandBuffer)             \
  F(FlushMappedMemoryRanges)      \
  F(FreeMemory)                   \
  F(GetBufferMemoryRequirements)  \
  F(GetImageMemoryRequirements)   \
  F(GetQueryPoolResults)          \
  F(InvalidateMappedMemoryRanges) \
  F(MapMemory)                    \
  F(QueueSubmit)                  \
  F(ResetFences)                  \
  F(UpdateDescriptorSets)         \
  F(WaitForFences)

struct VulkanTable {
#define LL_MEMBER(name) PFN_vk##name name = nullptr;
  LL_INSTANCE_FUNCTIONS(LL_MEMBER)
  LL_DEVICE_FUNCTIONS(LL_MEMBER)
#undef LL_MEMBER

  /// OutOfRange if the loader lacks one.
  absl::Status load_instance(VkInstance instance, PFN_vkGetInstanceProcAddr get);
  /// REQUIRES: load_instance. `get` may be null.
  absl::Status load_device(VkDevice device, PFN_vkGetDeviceProcAddr get);
};

}  // namespace lightloom
