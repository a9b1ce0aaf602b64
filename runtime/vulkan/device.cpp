#include "runtime/vulkan/device.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <vector>

#include "runtime/shaders/layout.h"
#include "runtime/vulkan/status.h"

namespace lightloom {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";
/// Storage buffers that the project and receive passes bind.
constexpr uint32_t kStorageBuffers = 7;
constexpr uint32_t kSharedBytes = 12 * 1024;

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
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

/// Small is better; -1: unusable. Sets the compute queue family.
int rank_device(VkPhysicalDevice physical, uint32_t* family, uint32_t* timestamp_bits) {
  VkPhysicalDeviceProperties properties;
  vkGetPhysicalDeviceProperties(physical, &properties);
  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
  const auto it = std::find_if(families.begin(), families.end(),
                               [](const auto& f) { return (f.queueFlags & VK_QUEUE_COMPUTE_BIT) != 0; });
  if (it == families.end() || properties.apiVersion < VK_API_VERSION_1_1) return -1;
  *family = static_cast<uint32_t>(it - families.begin());
  *timestamp_bits = it->timestampValidBits;
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

bool has_validation_layer() {
  uint32_t count = 0;
  if (vkEnumerateInstanceLayerProperties(&count, nullptr) != VK_SUCCESS) return false;
  std::vector<VkLayerProperties> layers(count);
  if (vkEnumerateInstanceLayerProperties(&count, layers.data()) < 0) return false;
  return std::any_of(layers.begin(), layers.end(),
                     [](const auto& l) { return std::strcmp(l.layerName, kValidationLayer) == 0; });
}

void memory_barrier(VkCommandBuffer commands, VkPipelineStageFlags from_stage, VkAccessFlags from,
                    VkPipelineStageFlags to_stage, VkAccessFlags to) {
  auto barrier = vulkan_struct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  barrier.srcAccessMask = from;
  barrier.dstAccessMask = to;
  vkCmdPipelineBarrier(commands, from_stage, to_stage, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

}  // namespace

void barrier_between_passes(VkCommandBuffer commands) {
  memory_barrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_WRITE_BIT,
                 VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT, VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT);
}

void barrier_to_all(VkCommandBuffer commands) {
  memory_barrier(commands, VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT,
                 VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT,
                 VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_HOST_BIT,
                 VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_READ_BIT |
                     VK_ACCESS_TRANSFER_WRITE_BIT | VK_ACCESS_HOST_READ_BIT);
}

absl::StatusOr<std::unique_ptr<Device>> Device::create(bool validation, Messages messages) {
  std::unique_ptr<Device> device(new Device);
  device->messages_ = messages;
  LL_RETURN_IF_ERROR(device->create_instance(validation));
  LL_RETURN_IF_ERROR(device->pick_physical_device());
  LL_RETURN_IF_ERROR(device->create_device());
  return device;
}

absl::Status Device::create_instance(bool validation) {
  if (validation && !has_validation_layer()) {
    return absl::OutOfRangeError(std::string(kValidationLayer) +
                                 " is not installed; install vulkan-validationlayers or create without validation");
  }
  auto application = vulkan_struct<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.pEngineName = "lightloom";
  application.apiVersion = VK_API_VERSION_1_1;

  const VkValidationFeatureEnableEXT enables[] = {VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
  auto features = vulkan_struct<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = enables;
  // Chained to the instance too, so that what goes wrong while the instance is destroyed is heard.
  VkDebugUtilsMessengerCreateInfoEXT messenger = messenger_info(&messages_);
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
  LL_VK_RETURN_IF_ERROR("vkCreateInstance", vkCreateInstance(&info, nullptr, &instance_));
  if (!validation) return absl::OkStatus();
  const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
      vkGetInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
  messenger.pNext = nullptr;
  LL_VK_RETURN_IF_ERROR("vkCreateDebugUtilsMessengerEXT", create(instance_, &messenger, nullptr, &messenger_));
  return absl::OkStatus();
}

absl::Status Device::pick_physical_device() {
  uint32_t count = 0;
  LL_VK_RETURN_IF_ERROR("vkEnumeratePhysicalDevices", vkEnumeratePhysicalDevices(instance_, &count, nullptr));
  std::vector<VkPhysicalDevice> devices(count);
  if (count > 0) {
    LL_VK_RETURN_IF_ERROR("vkEnumeratePhysicalDevices", vkEnumeratePhysicalDevices(instance_, &count, devices.data()));
  }
  int best = -1;
  for (const VkPhysicalDevice physical : devices) {
    uint32_t family = 0, bits = 0;
    const int rank = rank_device(physical, &family, &bits);
    if (rank < 0 || (best >= 0 && rank >= best)) continue;
    best = rank;
    physical_ = physical;
    family_ = family;
    timestamp_bits_ = bits;
  }
  if (best < 0) {
    return absl::NotFoundError("no Vulkan 1.1 device with a compute queue among " + std::to_string(count) +
                               "; install a driver (mesa-vulkan-drivers has a software one) or check VK_ICD_FILENAMES");
  }
  vkGetPhysicalDeviceProperties(physical_, &properties_);
  vkGetPhysicalDeviceMemoryProperties(physical_, &memory_);
  const VkPhysicalDeviceLimits& l = properties_.limits;
  if (l.maxPerStageDescriptorStorageBuffers < kStorageBuffers || l.maxComputeWorkGroupInvocations < gpu::kGroup ||
      l.maxComputeSharedMemorySize < kSharedBytes) {
    return absl::OutOfRangeError(std::string("device '") + properties_.deviceName +
                                 "' lacks 7 storage buffers per stage, workgroups of 64 or 12 KiB of shared memory");
  }
  return absl::OkStatus();
}

absl::Status Device::create_device() {
  const float priority = 1;
  auto queue = vulkan_struct<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue.queueFamilyIndex = family_;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;
  auto info = vulkan_struct<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue;
  LL_VK_RETURN_IF_ERROR("vkCreateDevice", vkCreateDevice(physical_, &info, nullptr, &device_));
  vkGetDeviceQueue(device_, family_, 0, &queue_);

  auto pool = vulkan_struct<VkCommandPoolCreateInfo>(VK_STRUCTURE_TYPE_COMMAND_POOL_CREATE_INFO);
  pool.flags = VK_COMMAND_POOL_CREATE_RESET_COMMAND_BUFFER_BIT;
  pool.queueFamilyIndex = family_;
  LL_VK_RETURN_IF_ERROR("vkCreateCommandPool", vkCreateCommandPool(device_, &pool, nullptr, &pool_));
  auto buffer = vulkan_struct<VkCommandBufferAllocateInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_ALLOCATE_INFO);
  buffer.commandPool = pool_;
  buffer.level = VK_COMMAND_BUFFER_LEVEL_PRIMARY;
  buffer.commandBufferCount = 1;
  LL_VK_RETURN_IF_ERROR("vkAllocateCommandBuffers", vkAllocateCommandBuffers(device_, &buffer, &commands_));
  const auto fence = vulkan_struct<VkFenceCreateInfo>(VK_STRUCTURE_TYPE_FENCE_CREATE_INFO);
  LL_VK_RETURN_IF_ERROR("vkCreateFence", vkCreateFence(device_, &fence, nullptr, &fence_));
  return absl::OkStatus();
}

Device::~Device() {
  if (device_ != VK_NULL_HANDLE) {
    vkDestroyFence(device_, fence_, nullptr);
    vkDestroyCommandPool(device_, pool_, nullptr);
    vkDestroyDevice(device_, nullptr);
  }
  if (messenger_ != VK_NULL_HANDLE) {
    const auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(instance_, "vkDestroyDebugUtilsMessengerEXT"));
    destroy(instance_, messenger_, nullptr);
  }
  if (instance_ != VK_NULL_HANDLE) vkDestroyInstance(instance_, nullptr);
}

absl::Status Device::run(const std::function<void(VkCommandBuffer)>& record) {
  auto begin = vulkan_struct<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  LL_VK_RETURN_IF_ERROR("vkBeginCommandBuffer", vkBeginCommandBuffer(commands_, &begin));
  record(commands_);
  LL_VK_RETURN_IF_ERROR("vkEndCommandBuffer", vkEndCommandBuffer(commands_));
  auto submit = vulkan_struct<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands_;
  LL_VK_RETURN_IF_ERROR("vkQueueSubmit", vkQueueSubmit(queue_, 1, &submit, fence_));
  LL_VK_RETURN_IF_ERROR("vkWaitForFences", vkWaitForFences(device_, 1, &fence_, VK_TRUE, UINT64_MAX));
  LL_VK_RETURN_IF_ERROR("vkResetFences", vkResetFences(device_, 1, &fence_));
  return absl::OkStatus();
}

}  // namespace lightloom
