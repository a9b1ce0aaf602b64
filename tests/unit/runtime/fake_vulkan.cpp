#include "tests/unit/runtime/fake_vulkan.h"

#include <cstdlib>
#include <cstring>
#include <type_traits>

#include "runtime/vulkan/table.h"

namespace lightloom::testing {

FakeVulkan fake;

namespace {

VkResult may_fail() { return ++fake.calls == fake.fail_at ? fake.failure : VK_SUCCESS; }
void check(const VkAllocationCallbacks* callbacks) { fake.wrong_callbacks += callbacks != fake.callbacks; }

/// Handles are pointers to a few bytes of their own, so that a leak is a leak for sanitizers too.
struct Object {
  void* mapped;
  uint64_t size;
};

/// Commands, queries of nothing: VK_SUCCESS and no more.
template <class F>
struct Stub;
template <class R, class... A>
struct Stub<R(VKAPI_PTR*)(A...)> {
  static VKAPI_ATTR R VKAPI_CALL call(A...) {
    if constexpr (!std::is_void_v<R>) return may_fail();
  }
};

template <class F>
struct Create;
template <class I, class H>
struct Create<VkResult(VKAPI_PTR*)(VkDevice, const I*, const VkAllocationCallbacks*, H*)> {
  static VKAPI_ATTR VkResult VKAPI_CALL call(VkDevice, const I* info, const VkAllocationCallbacks* callbacks, H* out) {
    check(callbacks);
    if (const VkResult failed = may_fail(); failed != VK_SUCCESS) return failed;
    uint64_t size = 0;
    if constexpr (std::is_same_v<I, VkMemoryAllocateInfo>) size = info->allocationSize;
    if constexpr (std::is_same_v<I, VkBufferCreateInfo>) size = info->size;
    *out = reinterpret_cast<H>(new Object{nullptr, size});
    ++fake.live;
    ++fake.created;
    return VK_SUCCESS;
  }
};

template <class F>
struct Destroy;
template <class H>
struct Destroy<void(VKAPI_PTR*)(VkDevice, H, const VkAllocationCallbacks*)> {
  static VKAPI_ATTR void VKAPI_CALL call(VkDevice, H handle, const VkAllocationCallbacks* callbacks) {
    check(callbacks);
    if (handle == VK_NULL_HANDLE) return;
    auto* object = reinterpret_cast<Object*>(handle);
    std::free(object->mapped);
    delete object;
    --fake.live;
  }
};

VKAPI_ATTR VkResult VKAPI_CALL create_pipelines(VkDevice device, VkPipelineCache, uint32_t,
                                                const VkComputePipelineCreateInfo* info,
                                                const VkAllocationCallbacks* callbacks, VkPipeline* out) {
  using Function =
      VkResult(VKAPI_PTR*)(VkDevice, const VkComputePipelineCreateInfo*, const VkAllocationCallbacks*, VkPipeline*);
  return Create<Function>::call(device, info, callbacks, out);
}
VKAPI_ATTR VkResult VKAPI_CALL allocate_sets(VkDevice, const VkDescriptorSetAllocateInfo*, VkDescriptorSet* out) {
  static Object set;
  *out = reinterpret_cast<VkDescriptorSet>(&set);
  return may_fail();
}
VKAPI_ATTR VkResult VKAPI_CALL map(VkDevice, VkDeviceMemory memory, VkDeviceSize, VkDeviceSize, VkMemoryMapFlags,
                                   void** out) {
  if (const VkResult failed = may_fail(); failed != VK_SUCCESS) return failed;
  auto* object = reinterpret_cast<Object*>(memory);
  object->mapped = std::calloc(1, object->size);
  *out = object->mapped;
  return VK_SUCCESS;
}
VKAPI_ATTR VkResult VKAPI_CALL flush(VkDevice, uint32_t, const VkMappedMemoryRange*) {
  ++fake.flushes;
  return may_fail();
}
VKAPI_ATTR VkResult VKAPI_CALL query_results(VkDevice, VkQueryPool, uint32_t, uint32_t, size_t size, void* out,
                                             VkDeviceSize, VkQueryResultFlags) {
  std::memset(out, 0, size);
  return may_fail();
}
VKAPI_ATTR void VKAPI_CALL buffer_needs(VkDevice, VkBuffer buffer, VkMemoryRequirements* out) {
  *out = {(reinterpret_cast<Object*>(buffer)->size + 255) / 256 * 256, 256, 3};
}
VKAPI_ATTR void VKAPI_CALL image_needs(VkDevice, VkImage, VkMemoryRequirements* out) { *out = {4096, 256, 3}; }
VKAPI_ATTR void VKAPI_CALL memory_properties(VkPhysicalDevice, VkPhysicalDeviceMemoryProperties* out) {
  *out = {};
  out->memoryTypeCount = 2;
  out->memoryTypes[0] = {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0};
  out->memoryTypes[1] = {VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT, 1};
  out->memoryHeapCount = 2;
}
VKAPI_ATTR void VKAPI_CALL format_properties(VkPhysicalDevice, VkFormat, VkFormatProperties* out) { *out = {}; }
VKAPI_ATTR void VKAPI_CALL queue_families(VkPhysicalDevice, uint32_t* count, VkQueueFamilyProperties* out) {
  *count = 1;
  out[0] = {VK_QUEUE_COMPUTE_BIT, 1, 64, {1, 1, 1}};
}
VKAPI_ATTR void VKAPI_CALL properties(VkPhysicalDevice, VkPhysicalDeviceProperties* out) {
  *out = {};
  out->apiVersion = VK_API_VERSION_1_1;
  std::strcpy(out->deviceName, "fake");
  VkPhysicalDeviceLimits& l = out->limits;
  l.maxPerStageDescriptorStorageBuffers = fake.storage_buffers;
  l.maxComputeWorkGroupInvocations = l.maxComputeWorkGroupSize[0] = 128;
  l.maxComputeSharedMemorySize = 16384;
  l.maxPushConstantsSize = 128;
  l.maxStorageBufferRange = 1u << 27;
  l.maxComputeWorkGroupCount[0] = l.maxComputeWorkGroupCount[1] = 65535;
  l.minStorageBufferOffsetAlignment = l.nonCoherentAtomSize = 64;
  l.maxImageDimension2D = 4096;
  l.timestampPeriod = 1;
}

PFN_vkVoidFunction find(const char* name);
VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_proc(VkDevice, const char* name) { return find(name); }

PFN_vkVoidFunction find(const char* name) {
#define LL_ENTRY(function, implementation) \
  if (std::strcmp(name, "vk" #function) == 0) return reinterpret_cast<PFN_vkVoidFunction>(&implementation);
#define LL_CREATE(function) LL_ENTRY(function, Create<PFN_vk##function>::call)
#define LL_DESTROY(function) LL_ENTRY(function, Destroy<PFN_vk##function>::call)
#define LL_STUB(function) LL_ENTRY(function, Stub<PFN_vk##function>::call)
  LL_CREATE(AllocateMemory)
  LL_CREATE(CreateBuffer)
  LL_CREATE(CreateDescriptorPool)
  LL_CREATE(CreateDescriptorSetLayout)
  LL_CREATE(CreateImage)
  LL_CREATE(CreateImageView)
  LL_CREATE(CreatePipelineLayout)
  LL_CREATE(CreateQueryPool)
  LL_CREATE(CreateSampler)
  LL_CREATE(CreateShaderModule)
  LL_DESTROY(FreeMemory)
  LL_DESTROY(DestroyBuffer)
  LL_DESTROY(DestroyDescriptorPool)
  LL_DESTROY(DestroyDescriptorSetLayout)
  LL_DESTROY(DestroyImage)
  LL_DESTROY(DestroyImageView)
  LL_DESTROY(DestroyPipeline)
  LL_DESTROY(DestroyPipelineLayout)
  LL_DESTROY(DestroyQueryPool)
  LL_DESTROY(DestroySampler)
  LL_DESTROY(DestroyShaderModule)
  LL_ENTRY(CreateComputePipelines, create_pipelines)
  LL_ENTRY(AllocateDescriptorSets, allocate_sets)
  LL_ENTRY(MapMemory, map)
  LL_ENTRY(FlushMappedMemoryRanges, flush)
  LL_ENTRY(GetQueryPoolResults, query_results)
  LL_ENTRY(GetBufferMemoryRequirements, buffer_needs)
  LL_ENTRY(GetImageMemoryRequirements, image_needs)
  LL_ENTRY(GetPhysicalDeviceMemoryProperties, memory_properties)
  LL_ENTRY(GetPhysicalDeviceFormatProperties, format_properties)
  LL_ENTRY(GetPhysicalDeviceQueueFamilyProperties, queue_families)
  LL_ENTRY(GetPhysicalDeviceProperties, properties)
  LL_ENTRY(GetDeviceProcAddr, device_proc)
  LL_DEVICE_FUNCTIONS(LL_STUB)
  return nullptr;
}

}  // namespace

PFN_vkVoidFunction VKAPI_CALL fake_get_instance_proc_addr(VkInstance, const char* name) { return find(name); }

lightloom_vulkan_create_info FakeVulkan::create_info() const {
  static int handles[3];
  lightloom_vulkan_create_info info{};
  info.struct_size = sizeof info;
  info.flags = LIGHTLOOM_CREATE_SMOOTHING;
  info.instance = reinterpret_cast<VkInstance>(&handles[0]);
  info.physical_device = reinterpret_cast<VkPhysicalDevice>(&handles[1]);
  info.device = reinterpret_cast<VkDevice>(&handles[2]);
  info.get_instance_proc_addr = fake_get_instance_proc_addr;
  info.allocation_callbacks = callbacks;
  info.frames_in_flight = 2;
  info.staging_bytes = 1 << 20;
  info.image_format = VK_FORMAT_R16G16B16A16_SFLOAT;
  return info;
}

}  // namespace lightloom::testing
