#include "tests/unit/runtime/discrete_vulkan.h"

#include <algorithm>
#include <cstring>
#include <map>

#include "core/base/check.h"
#include "runtime/vulkan/table.h"

namespace lightloom::testing {

DiscreteVulkan discrete;

namespace {

constexpr uint32_t kLocal = 0, kHost = 1;
/// Coarser than lavapipe's, so that rounding matters.
constexpr uint64_t kAtom = 256;
/// Not a number as float, and no index of anything.
constexpr int kPoison = 0xff;

VulkanTable real;

struct Allocation {
  uint32_t type;
  uint64_t size;
  uint8_t* device = nullptr;    ///< what shaders see, once mapped
  std::vector<uint8_t> mapped;  ///< what the host sees
};
std::map<VkDeviceMemory, Allocation> allocations;

void complain(const std::string& what) { discrete.complaints.push_back(what); }

VKAPI_ATTR void VKAPI_CALL memory_properties(VkPhysicalDevice, VkPhysicalDeviceMemoryProperties* out) {
  *out = {};
  out->memoryTypeCount = out->memoryHeapCount = 2;
  out->memoryTypes[kLocal] = {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, kLocal};
  out->memoryTypes[kHost] = {VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT, kHost};
  out->memoryHeaps[kLocal] = {discrete.heaps[kLocal].size, VK_MEMORY_HEAP_DEVICE_LOCAL_BIT};
  out->memoryHeaps[kHost] = {discrete.heaps[kHost].size, 0};
}

VKAPI_ATTR void VKAPI_CALL properties(VkPhysicalDevice physical, VkPhysicalDeviceProperties* out) {
  real.GetPhysicalDeviceProperties(physical, out);
  LL_CHECK(kAtom % out->limits.nonCoherentAtomSize == 0);
  out->deviceType = VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
  out->limits.nonCoherentAtomSize = kAtom;
}

VKAPI_ATTR void VKAPI_CALL buffer_needs(VkDevice device, VkBuffer buffer, VkMemoryRequirements* out) {
  real.GetBufferMemoryRequirements(device, buffer, out);
  out->memoryTypeBits = 1u << kLocal | 1u << kHost;
}
/// Images live on the device.
VKAPI_ATTR void VKAPI_CALL image_needs(VkDevice device, VkImage image, VkMemoryRequirements* out) {
  real.GetImageMemoryRequirements(device, image, out);
  out->memoryTypeBits = 1u << kLocal;
}

VKAPI_ATTR VkResult VKAPI_CALL allocate(VkDevice device, const VkMemoryAllocateInfo* info,
                                        const VkAllocationCallbacks* callbacks, VkDeviceMemory* out) {
  const uint32_t type = info->memoryTypeIndex;
  LL_CHECK(type <= kHost);
  DiscreteHeap& heap = discrete.heaps[type];
  if (info->allocationSize > heap.size - heap.used) return VK_ERROR_OUT_OF_DEVICE_MEMORY;
  VkMemoryAllocateInfo only = *info;
  only.memoryTypeIndex = 0;
  const VkResult result = real.AllocateMemory(device, &only, callbacks, out);
  if (result != VK_SUCCESS) return result;
  heap.used += info->allocationSize;
  heap.most = std::max(heap.most, heap.used);
  ++discrete.live;
  allocations[*out] = {type, info->allocationSize, nullptr, {}};
  return VK_SUCCESS;
}

VKAPI_ATTR void VKAPI_CALL release(VkDevice device, VkDeviceMemory memory, const VkAllocationCallbacks* callbacks) {
  if (const auto found = allocations.find(memory); found != allocations.end()) {
    discrete.heaps[found->second.type].used -= found->second.size;
    --discrete.live;
    allocations.erase(found);
  }
  real.FreeMemory(device, memory, callbacks);
}

VKAPI_ATTR VkResult VKAPI_CALL map(VkDevice device, VkDeviceMemory memory, VkDeviceSize offset, VkDeviceSize size,
                                   VkMemoryMapFlags flags, void** out) {
  Allocation& a = allocations.at(memory);
  if (a.type != kHost || offset != 0 || size != VK_WHOLE_SIZE) {
    complain("vkMapMemory of device-local memory, or of a part");
    return VK_ERROR_MEMORY_MAP_FAILED;
  }
  void* there = nullptr;
  const VkResult result = real.MapMemory(device, memory, offset, size, flags, &there);
  if (result != VK_SUCCESS) return result;
  a.device = static_cast<uint8_t*>(there);
  std::memset(a.device, kPoison, a.size);
  a.mapped.assign(a.size, kPoison);
  *out = a.mapped.data();
  return VK_SUCCESS;
}

/// The allocation and the length, if the range follows the rules.
Allocation* check_range(const char* function, const VkMappedMemoryRange& range, uint64_t* size) {
  const auto found = allocations.find(range.memory);
  if (found == allocations.end() || found->second.device == nullptr) {
    complain(std::string(function) + ": not mapped");
    return nullptr;
  }
  Allocation& a = found->second;
  *size = range.size == VK_WHOLE_SIZE ? a.size - std::min(a.size, range.offset) : range.size;
  const bool ends = range.offset + *size == a.size;
  if (range.offset % kAtom != 0 || range.offset > a.size || *size > a.size - range.offset ||
      (*size % kAtom != 0 && !ends)) {
    complain(std::string(function) + ": [" + std::to_string(range.offset) + ", +" + std::to_string(*size) + ") of " +
             std::to_string(a.size) + " is outside or not aligned");
    return nullptr;
  }
  return &a;
}

VKAPI_ATTR VkResult VKAPI_CALL flush(VkDevice device, uint32_t count, const VkMappedMemoryRange* ranges) {
  for (uint32_t i = 0; i < count; ++i) {
    uint64_t size = 0;
    if (Allocation* const a = check_range("vkFlushMappedMemoryRanges", ranges[i], &size)) {
      std::memcpy(a->device + ranges[i].offset, a->mapped.data() + ranges[i].offset, size);
      ++discrete.flushes;
    }
  }
  return real.FlushMappedMemoryRanges(device, count, ranges);
}

VKAPI_ATTR VkResult VKAPI_CALL invalidate(VkDevice device, uint32_t count, const VkMappedMemoryRange* ranges) {
  const VkResult result = real.InvalidateMappedMemoryRanges(device, count, ranges);
  for (uint32_t i = 0; i < count; ++i) {
    uint64_t size = 0;
    if (Allocation* const a = check_range("vkInvalidateMappedMemoryRanges", ranges[i], &size)) {
      std::memcpy(a->mapped.data() + ranges[i].offset, a->device + ranges[i].offset, size);
      ++discrete.invalidates;
    }
  }
  return result;
}

PFN_vkVoidFunction find(const char* name) {
#define LL_ENTRY(function, implementation) \
  if (std::strcmp(name, "vk" #function) == 0) return reinterpret_cast<PFN_vkVoidFunction>(&implementation);
  LL_ENTRY(GetPhysicalDeviceMemoryProperties, memory_properties)
  LL_ENTRY(GetPhysicalDeviceProperties, properties)
  LL_ENTRY(GetBufferMemoryRequirements, buffer_needs)
  LL_ENTRY(GetImageMemoryRequirements, image_needs)
  LL_ENTRY(AllocateMemory, allocate)
  LL_ENTRY(FreeMemory, release)
  LL_ENTRY(MapMemory, map)
  LL_ENTRY(FlushMappedMemoryRanges, flush)
  LL_ENTRY(InvalidateMappedMemoryRanges, invalidate)
#undef LL_ENTRY
  return nullptr;
}

PFN_vkGetInstanceProcAddr real_instance_proc;

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_proc(VkDevice device, const char* name) {
  const PFN_vkVoidFunction ours = find(name);
  return ours != nullptr ? ours : real.GetDeviceProcAddr(device, name);
}
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL instance_proc(VkInstance instance, const char* name) {
  if (std::strcmp(name, "vkGetDeviceProcAddr") == 0) return reinterpret_cast<PFN_vkVoidFunction>(&device_proc);
  const PFN_vkVoidFunction ours = find(name);
  return ours != nullptr ? ours : real_instance_proc(instance, name);
}

}  // namespace

void make_discrete(const lightloom_vulkan_device& device, uint64_t device_heap, uint64_t host_heap,
                   lightloom_vulkan_create_info* info) {
  discrete = {};
  discrete.heaps[kLocal].size = device_heap;
  discrete.heaps[kHost].size = host_heap;
  allocations.clear();
  real_instance_proc = device.get_instance_proc_addr;
  LL_CHECK(real.load_instance(device.instance, real_instance_proc).ok());
  LL_CHECK(real.load_device(device.device, nullptr).ok());
  info->get_instance_proc_addr = instance_proc;
  info->get_device_proc_addr = nullptr;
}

}  // namespace lightloom::testing
