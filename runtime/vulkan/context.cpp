#include "runtime/vulkan/context.h"

#include <array>

#include "runtime/vulkan/pipelines.h"

namespace lightloom {

const Requirements& requirements() {
  static constexpr Requirements kRequirements = {VK_API_VERSION_1_1, kMaxBindings,  gpu::kDefaultGroup,
                                                 16 * 1024,          kMaxPushBytes, 1ull << 27};
  return kRequirements;
}

absl::Status check_device(const VulkanTable& vk, VkPhysicalDevice physical, uint32_t queue_family,
                          uint32_t* timestamp_bits) {
  const Requirements& need = requirements();
  VkPhysicalDeviceProperties properties;
  vk.GetPhysicalDeviceProperties(physical, &properties);
  const VkPhysicalDeviceLimits& has = properties.limits;
  std::string lacks;
  const auto demand = [&lacks](const char* what, uint64_t value, uint64_t least) {
    if (value >= least) return;
    lacks += (lacks.empty() ? "" : ", ") + std::string(what) + " " + std::to_string(value) + " (needs " +
             std::to_string(least) + ")";
  };
  demand("apiVersion", properties.apiVersion, need.api_version);
  demand("maxPerStageDescriptorStorageBuffers", has.maxPerStageDescriptorStorageBuffers, need.storage_buffers);
  demand("maxComputeWorkGroupInvocations", has.maxComputeWorkGroupInvocations, need.invocations);
  demand("maxComputeWorkGroupSize[0]", has.maxComputeWorkGroupSize[0], need.invocations);
  demand("maxComputeSharedMemorySize", has.maxComputeSharedMemorySize, need.shared_bytes);
  demand("maxPushConstantsSize", has.maxPushConstantsSize, need.push_bytes);
  demand("maxStorageBufferRange", has.maxStorageBufferRange, need.storage_range);

  // More families than any device has.
  std::array<VkQueueFamilyProperties, 64> families;
  uint32_t count = families.size();
  vk.GetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
  const bool compute = queue_family < count && (families[queue_family].queueFlags & VK_QUEUE_COMPUTE_BIT) != 0;
  if (!compute) lacks += (lacks.empty() ? "" : ", ") + ("compute in queue family " + std::to_string(queue_family));
  if (timestamp_bits != nullptr) *timestamp_bits = compute ? families[queue_family].timestampValidBits : 0;
  if (lacks.empty()) return absl::OkStatus();
  return absl::OutOfRangeError(std::string("device '") + properties.deviceName + "' lacks: " + lacks +
                               "; choose another device");
}

}  // namespace lightloom
