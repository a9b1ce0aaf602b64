// A Vulkan instance, device and queue for programs that have none. The loader is opened at run time, so that the library
// links to none.
#include <dlfcn.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <memory>
#include <string>
#include <vector>

#include "runtime/boundary.h"
#include "runtime/include/lightloom_vulkan.h"
#include "runtime/vulkan/context.h"

namespace lightloom {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

/// Behind lightloom_vulkan_device::internal.
struct Internal {
  Messages messages;
  void* loader = nullptr;
  PFN_vkGetInstanceProcAddr get = nullptr;
  VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
};

template <class Function>
Function find(PFN_vkGetInstanceProcAddr get, VkInstance instance, const char* name) {
  return reinterpret_cast<Function>(get(instance, name));
}

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
  // GPU-assisted validation tells about itself.
  if (data->pMessageIdName != nullptr && std::strstr(data->pMessageIdName, "Setup") != nullptr) return VK_FALSE;
  static_cast<const Messages*>(user)->send(LIGHTLOOM_MESSAGE_VALIDATION, data->pMessage);
  return VK_FALSE;
}

VkDebugUtilsMessengerCreateInfoEXT messenger_info(Messages* messages) {
  auto info =
      vulkan_struct<VkDebugUtilsMessengerCreateInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
  info.messageSeverity =
      VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  // Not GENERAL: there the loader complains about drivers that we do not use.
  info.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_TYPE_PERFORMANCE_BIT_EXT;
  info.pfnUserCallback = on_message;
  info.pUserData = messages;
  return info;
}

bool has_validation_layer(PFN_vkGetInstanceProcAddr get) {
  const auto enumerate =
      find<PFN_vkEnumerateInstanceLayerProperties>(get, nullptr, "vkEnumerateInstanceLayerProperties");
  uint32_t count = 0;
  if (enumerate == nullptr || enumerate(&count, nullptr) != VK_SUCCESS) return false;
  std::vector<VkLayerProperties> layers(count);
  if (enumerate(&count, layers.data()) < 0) return false;
  return std::any_of(layers.begin(), layers.end(),
                     [](const auto& l) { return std::strcmp(l.layerName, kValidationLayer) == 0; });
}

absl::Status create_instance(uint32_t flags, Internal* internal, VkInstance* out) {
  const bool validation = (flags & LIGHTLOOM_CREATE_VALIDATION) != 0;
  if (validation && !has_validation_layer(internal->get)) {
    return absl::OutOfRangeError(std::string(kValidationLayer) +
                                 " is not installed; install vulkan-validationlayers or create without validation");
  }
  auto application = vulkan_struct<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.pApplicationName = "lightloom";
  application.apiVersion = VK_API_VERSION_1_1;
  // The two kinds do not go together in one instance.
  const bool assisted = (flags & LIGHTLOOM_CREATE_GPU_ASSISTED) != 0;
  const VkValidationFeatureEnableEXT enables[] = {assisted
                                                      ? VK_VALIDATION_FEATURE_ENABLE_GPU_ASSISTED_EXT
                                                      : VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
  auto features = vulkan_struct<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = enables;
  // Chained to the instance too, so that what goes wrong while the instance is destroyed is heard.
  VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(&internal->messages);
  messenger.pNext = &features;
  const char* extensions[] = {VK_EXT_DEBUG_UTILS_EXTENSION_NAME, VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
  auto info = vulkan_struct<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  info.pApplicationInfo = &application;
  if (validation) {
    info.pNext = &messenger;
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &kValidationLayer;
    info.enabledExtensionCount = 2;
    info.ppEnabledExtensionNames = extensions;
  }
  const auto create = find<PFN_vkCreateInstance>(internal->get, nullptr, "vkCreateInstance");
  LL_VK_RETURN_IF_ERROR("vkCreateInstance", create(&info, nullptr, out));
  if (!validation) return absl::OkStatus();
  const auto create_messenger =
      find<PFN_vkCreateDebugUtilsMessengerEXT>(internal->get, *out, "vkCreateDebugUtilsMessengerEXT");
  messenger.pNext = nullptr;
  return vulkan_status(create_messenger(*out, &messenger, nullptr, &internal->messenger),
                       "vkCreateDebugUtilsMessengerEXT");
}

/// Small is better.
int rank_of(const VulkanTable& vk, VkPhysicalDevice physical) {
  VkPhysicalDeviceProperties properties;
  vk.GetPhysicalDeviceProperties(physical, &properties);
  switch (properties.deviceType) {
    case VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU:
      return 0;
    case VK_PHYSICAL_DEVICE_TYPE_INTEGRATED_GPU:
      return 1;
    case VK_PHYSICAL_DEVICE_TYPE_VIRTUAL_GPU:
      return 2;
    default:
      return 3;
  }
}

absl::Status pick(const VulkanTable& vk, PFN_vkGetInstanceProcAddr get, VkQueueFlags queue_flags,
                  lightloom_vulkan_device* out) {
  const auto enumerate = find<PFN_vkEnumeratePhysicalDevices>(get, out->instance, "vkEnumeratePhysicalDevices");
  uint32_t count = 0;
  LL_VK_RETURN_IF_ERROR("vkEnumeratePhysicalDevices", enumerate(out->instance, &count, nullptr));
  std::vector<VkPhysicalDevice> devices(count);
  if (count > 0) {
    LL_VK_RETURN_IF_ERROR("vkEnumeratePhysicalDevices", enumerate(out->instance, &count, devices.data()));
  }
  std::stable_sort(devices.begin(), devices.end(),
                   [&vk](VkPhysicalDevice a, VkPhysicalDevice b) { return rank_of(vk, a) < rank_of(vk, b); });
  absl::Status why =
      absl::NotFoundError("no Vulkan device with such a queue among " + std::to_string(count) +
                          "; install a driver (mesa-vulkan-drivers has a software one) or check VK_ICD_FILENAMES");
  for (const VkPhysicalDevice physical : devices) {
    std::array<VkQueueFamilyProperties, 64> families;
    uint32_t n = families.size();
    vk.GetPhysicalDeviceQueueFamilyProperties(physical, &n, families.data());
    const VkQueueFlags wanted = queue_flags | VK_QUEUE_COMPUTE_BIT;
    for (uint32_t f = 0; f < n; ++f) {
      if ((families[f].queueFlags & wanted) != wanted) continue;
      const absl::Status good = check_device(vk, physical, f, nullptr);
      if (!good.ok()) {
        why = good;
        continue;
      }
      out->physical_device = physical;
      out->queue_family = f;
      return absl::OkStatus();
    }
  }
  return why;
}

absl::Status make_device(const lightloom_vulkan_device_info& info, Internal* internal, lightloom_vulkan_device* out) {
  for (const char* name : {"libvulkan.so.1", "libvulkan.so"}) {
    if (internal->loader == nullptr) internal->loader = dlopen(name, RTLD_NOW | RTLD_LOCAL);
  }
  if (internal->loader == nullptr) return absl::NotFoundError("no Vulkan loader; install libvulkan1");
  internal->get = reinterpret_cast<PFN_vkGetInstanceProcAddr>(dlsym(internal->loader, "vkGetInstanceProcAddr"));
  if (internal->get == nullptr) return absl::NotFoundError("libvulkan.so.1 is no Vulkan loader; install libvulkan1");
  out->get_instance_proc_addr = internal->get;
  LL_RETURN_IF_ERROR(create_instance(info.flags, internal, &out->instance));
  VulkanTable vk;
  LL_RETURN_IF_ERROR(vk.load_instance(out->instance, internal->get));
  LL_RETURN_IF_ERROR(pick(vk, internal->get, info.queue_flags, out));

  const float priority = 1;
  auto queue = vulkan_struct<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue.queueFamilyIndex = out->queue_family;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;
  // GPU-assisted validation writes from shaders.
  VkPhysicalDeviceFeatures enabled{};
  if ((info.flags & LIGHTLOOM_CREATE_GPU_ASSISTED) != 0) {
    enabled.fragmentStoresAndAtomics = VK_TRUE;
    enabled.vertexPipelineStoresAndAtomics = VK_TRUE;
    enabled.robustBufferAccess = VK_TRUE;
  }
  auto create_info = vulkan_struct<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  create_info.queueCreateInfoCount = 1;
  create_info.pQueueCreateInfos = &queue;
  create_info.pEnabledFeatures = &enabled;
  const auto create = find<PFN_vkCreateDevice>(internal->get, out->instance, "vkCreateDevice");
  LL_VK_RETURN_IF_ERROR("vkCreateDevice", create(out->physical_device, &create_info, nullptr, &out->device));
  const auto get_queue = find<PFN_vkGetDeviceQueue>(internal->get, out->instance, "vkGetDeviceQueue");
  get_queue(out->device, out->queue_family, 0, &out->queue);
  return absl::OkStatus();
}

}  // namespace
}  // namespace lightloom

extern "C" {

lightloom_result lightloom_vulkan_make_device(const lightloom_vulkan_device_info* info, lightloom_vulkan_device* out) {
  if (out == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  *out = {};
  if (info == nullptr || info->struct_size < sizeof(lightloom_vulkan_device_info)) {
    return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  }
  const lightloom::Messages messages{info->message, info->message_user};
  const lightloom_result result = lightloom::guarded(messages, [&]() -> absl::Status {
    auto internal = std::make_unique<lightloom::Internal>();
    internal->messages = messages;
    out->internal = internal.get();
    return lightloom::make_device(*info, internal.release(), out);
  });
  if (result != LIGHTLOOM_OK) lightloom_vulkan_destroy_device(out);
  return result;
}

void lightloom_vulkan_destroy_device(lightloom_vulkan_device* device) {
  if (device == nullptr || device->internal == nullptr) return;
  auto* internal = static_cast<lightloom::Internal*>(device->internal);
  const auto get = internal->get;
  using lightloom::find;
  if (device->device != VK_NULL_HANDLE) {
    find<PFN_vkDestroyDevice>(get, device->instance, "vkDestroyDevice")(device->device, nullptr);
  }
  if (internal->messenger != VK_NULL_HANDLE) {
    find<PFN_vkDestroyDebugUtilsMessengerEXT>(get, device->instance, "vkDestroyDebugUtilsMessengerEXT")(
        device->instance, internal->messenger, nullptr);
  }
  if (device->instance != VK_NULL_HANDLE) {
    find<PFN_vkDestroyInstance>(get, device->instance, "vkDestroyInstance")(device->instance, nullptr);
  }
  if (internal->loader != nullptr) dlclose(internal->loader);
  delete internal;
  *device = {};
}

}  // extern "C"
