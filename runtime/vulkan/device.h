// A Vulkan instance, device and compute queue, and the one command buffer that is recorded, submitted and
// waited for.
#pragma once

#include <vulkan/vulkan.h>

#include <functional>
#include <memory>

#include "core/base/status.h"
#include "runtime/messages.h"

namespace lightloom {

class Device {
 public:
  /// NotFound: no device; OutOfRange: it, or the validation layer, lacks something.
  static absl::StatusOr<std::unique_ptr<Device>> create(bool validation, Messages messages);
  ~Device();
  Device(const Device&) = delete;
  Device& operator=(const Device&) = delete;

  VkDevice handle() const { return device_; }
  const VkPhysicalDeviceLimits& limits() const { return properties_.limits; }
  const VkPhysicalDeviceMemoryProperties& memory() const { return memory_; }
  /// 0: the queue has no time stamps.
  uint32_t timestamp_bits() const { return timestamp_bits_; }

  /// Records commands, submits them and waits until they are done. Commands must end with barrier_to_all() if
  /// they wrote.
  absl::Status run(const std::function<void(VkCommandBuffer)>& record);

 private:
  Device() = default;
  absl::Status create_instance(bool validation);
  absl::Status pick_physical_device();
  absl::Status create_device();

  Messages messages_;
  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  VkPhysicalDevice physical_ = VK_NULL_HANDLE;
  VkPhysicalDeviceProperties properties_{};
  VkPhysicalDeviceMemoryProperties memory_{};
  uint32_t family_ = 0, timestamp_bits_ = 0;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
};

/// What compute shaders wrote becomes visible to the next dispatches, which also wait for what they
/// overwrite.
void barrier_between_passes(VkCommandBuffer commands);
/// What shaders or copies wrote becomes visible to everything after: shaders, copies, and the host once it
/// has waited.
void barrier_to_all(VkCommandBuffer commands);

}  // namespace lightloom
