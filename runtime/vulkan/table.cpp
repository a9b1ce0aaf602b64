#include "runtime/vulkan/table.h"

#include <string>

namespace lightloom {
namespace {

absl::Status missing(const char* name) {
  return absl::OutOfRangeError(std::string("the Vulkan loader has no vk") + name + "; is it Vulkan 1.1?");
}

}  // namespace

absl::Status VulkanTable::load_instance(VkInstance instance, PFN_vkGetInstanceProcAddr get) {
#define LL_LOAD(name)                                               \
  name = reinterpret_cast<PFN_vk##name>(get(instance, "vk" #name)); \
  if (name == nullptr) return missing(#name);
  LL_INSTANCE_FUNCTIONS(LL_LOAD)
#undef LL_LOAD
  return absl::OkStatus();
}

absl::Status VulkanTable::load_device(VkDevice device, PFN_vkGetDeviceProcAddr get) {
  if (get == nullptr) get = GetDeviceProcAddr;
#define LL_LOAD(name)                                             \
  name = reinterpret_cast<PFN_vk##name>(get(device, "vk" #name)); \
  if (name == nullptr) return missing(#name);
  LL_DEVICE_FUNCTIONS(LL_LOAD)
#undef LL_LOAD
  return absl::OkStatus();
}

}  // namespace lightloom
