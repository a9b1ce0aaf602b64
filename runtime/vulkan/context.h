// The device that a runtime works on, and what it can do.
#pragma once

#include <cstdint>
#include <string>

#include "runtime/messages.h"
#include "runtime/vulkan/status.h"
#include "runtime/vulkan/table.h"

namespace lightloom {

/// Constant after creation but for `bytes`, which the owner of the runtime's mutex changes.
struct Context {
  VulkanTable vk;
  VkPhysicalDevice physical = VK_NULL_HANDLE;
  VkDevice device = VK_NULL_HANDLE;
  const VkAllocationCallbacks* callbacks = nullptr;
  VkPhysicalDeviceLimits limits{};
  VkPhysicalDeviceMemoryProperties memory{};
  uint32_t timestamp_bits = 0;  ///< 0: the queue has no time stamps
  bool linear_depth = false;    ///< D32_SFLOAT can be filtered
  uint32_t group = 0;           ///< invocations of a workgroup
  uint32_t max_groups = 0;      ///< along a dimension
  uint32_t frames = 0;          ///< in flight
  uint64_t page_bytes = 0;
  uint64_t budget = 0, bytes = 0;  ///< device memory of assets: allowed, taken
};

/// What the library asks of a device (docs/runtime.md).
struct Requirements {
  uint32_t api_version, storage_buffers, invocations, shared_bytes, push_bytes;
  uint64_t storage_range;
};
const Requirements& requirements();

/// OutOfRange, naming everything that lacks. `timestamp_bits` may be null.
absl::Status check_device(const VulkanTable& vk, VkPhysicalDevice physical, uint32_t queue_family,
                          uint32_t* timestamp_bits);

}  // namespace lightloom
