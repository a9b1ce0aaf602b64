// A Vulkan that does nothing: it counts objects, keeps memory that the host maps, and fails when it is told to. Its memory
// is laid out as on a discrete GPU: device-local memory cannot be mapped, host memory is not coherent.
#pragma once

#include "runtime/include/lightloom_vulkan.h"

namespace lightloom::testing {

struct FakeVulkan {
  int64_t live = 0;      ///< objects, memory and maps that are not destroyed
  uint64_t created = 0;  ///< ever
  uint64_t calls = 0;    ///< that may fail
  uint64_t fail_at = 0;  ///< number of the call that fails, from 1; 0: none
  VkResult failure = VK_ERROR_OUT_OF_DEVICE_MEMORY;
  uint64_t flushes = 0;
  uint32_t storage_buffers = 16;
  const VkAllocationCallbacks* callbacks = nullptr;  ///< that every call must give
  uint64_t wrong_callbacks = 0;

  void reset() { *this = FakeVulkan(); }
  lightloom_vulkan_create_info create_info() const;
};
extern FakeVulkan fake;

PFN_vkVoidFunction VKAPI_CALL fake_get_instance_proc_addr(VkInstance, const char* name);

}  // namespace lightloom::testing
