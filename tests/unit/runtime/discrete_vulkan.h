// A real Vulkan device whose memory looks like a discrete GPU's: device-local memory that cannot be mapped, and host memory
// that is not coherent, in small heaps. Mapped memory is a buffer apart, which reaches the device only by
// vkFlushMappedMemoryRanges and hears from it only by vkInvalidateMappedMemoryRanges.
#pragma once

#include <string>
#include <vector>

#include "runtime/include/lightloom_vulkan.h"

namespace lightloom::testing {

struct DiscreteHeap {
  uint64_t size = 0, used = 0, most = 0;
};

struct DiscreteVulkan {
  /// Device-local, host.
  DiscreteHeap heaps[2];
  std::vector<std::string> complaints;  ///< rules that were broken
  uint64_t flushes = 0, invalidates = 0;
  uint64_t live = 0;  ///< allocations
};
extern DiscreteVulkan discrete;

/// Starts anew on `device`, which must be a coherent one, and lets `info` see it so. One device at a time.
void make_discrete(const lightloom_vulkan_device& device, uint64_t device_heap, uint64_t host_heap,
                   lightloom_vulkan_create_info* info);

}  // namespace lightloom::testing
