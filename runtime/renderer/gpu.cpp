#include "runtime/renderer/gpu.h"

#include <algorithm>
#include <cstring>

#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";

VKAPI_ATTR VkBool32 VKAPI_CALL on_message(VkDebugUtilsMessageSeverityFlagBitsEXT, VkDebugUtilsMessageTypeFlagsEXT,
                                          const VkDebugUtilsMessengerCallbackDataEXT* data, void* user) {
  static_cast<std::vector<std::string>*>(user)->push_back(data->pMessage);
  return VK_FALSE;
}

int rank(VkPhysicalDeviceType type) {
  switch (type) {
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

VkImageSubresourceLayers level_of(const Texture2D& texture, uint32_t level) {
  return {VK_IMAGE_ASPECT_COLOR_BIT, level, 0, texture.layers};
}

/// Each level from the one above it, by halving.
void make_levels(VkCommandBuffer commands, const Texture2D& texture) {
  const auto side = [](uint32_t full, uint32_t level) { return static_cast<int32_t>(std::max(1u, full >> level)); };
  for (uint32_t level = 1; level < texture.levels; ++level) {
    transition(commands, texture.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kCopyTarget, kCopySource, level - 1, 1);
    VkImageBlit blit{};
    blit.srcSubresource = level_of(texture, level - 1);
    blit.srcOffsets[1] = {side(texture.width, level - 1), side(texture.height, level - 1), 1};
    blit.dstSubresource = level_of(texture, level);
    blit.dstOffsets[1] = {side(texture.width, level), side(texture.height, level), 1};
    vkCmdBlitImage(commands, texture.handle.get(), kCopySource.layout, texture.handle.get(), kCopyTarget.layout, 1,
                   &blit, VK_FILTER_LINEAR);
  }
  if (texture.levels > 1) {
    transition(commands, texture.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kCopySource, kSampled, 0, texture.levels - 1);
  }
  transition(commands, texture.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kCopyTarget, kSampled, texture.levels - 1, 1);
}

}  // namespace

absl::StatusOr<std::unique_ptr<Gpu>> Gpu::create(bool validation, std::vector<std::string>* messages,
                                                 const WindowSystem* window) {
  std::unique_ptr<Gpu> gpu(new Gpu);
  if (messages) gpu->messages_ = messages;
  LL_RETURN_IF_ERROR(gpu->create_instance(validation, window));
  if (window) {
    LL_ASSIGN_OR_RETURN(gpu->surface_, window->make_surface(gpu->instance_));
  }
  LL_RETURN_IF_ERROR(gpu->choose_device());
  LL_RETURN_IF_ERROR(gpu->create_device());
  return gpu;
}

absl::Status Gpu::create_instance(bool validation, const WindowSystem* window) {
  auto application = vulkan_struct<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.apiVersion = VK_API_VERSION_1_3;

  const VkValidationFeatureEnableEXT enables[] = {VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT};
  auto features = vulkan_struct<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = enables;
  auto messenger =
      vulkan_struct<VkDebugUtilsMessengerCreateInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
  messenger.messageSeverity =
      VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT;
  messenger.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
  messenger.pfnUserCallback = on_message;
  messenger.pUserData = messages_;
  messenger.pNext = &features;

  std::vector<const char*> extensions;
  if (window) extensions = window->instance_extensions;
  auto info = vulkan_struct<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  info.pApplicationInfo = &application;
  if (validation) {
    info.pNext = &messenger;
    info.enabledLayerCount = 1;
    info.ppEnabledLayerNames = &kValidationLayer;
    extensions.push_back(VK_EXT_DEBUG_UTILS_EXTENSION_NAME);
    extensions.push_back(VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME);
  }
  info.enabledExtensionCount = static_cast<uint32_t>(extensions.size());
  info.ppEnabledExtensionNames = extensions.data();
  LL_VK_RETURN_IF_ERROR("vkCreateInstance", vkCreateInstance(&info, nullptr, &instance_));
  if (!validation) return absl::OkStatus();
  const auto create = reinterpret_cast<PFN_vkCreateDebugUtilsMessengerEXT>(
      vkGetInstanceProcAddr(instance_, "vkCreateDebugUtilsMessengerEXT"));
  messenger.pNext = nullptr;
  LL_VK_RETURN_IF_ERROR("vkCreateDebugUtilsMessengerEXT", create(instance_, &messenger, nullptr, &messenger_));
  return absl::OkStatus();
}

/// The family whose queues draw and compute, and present if there is a window; or -1.
absl::StatusOr<int> Gpu::usable_family(VkPhysicalDevice physical) const {
  uint32_t count = 0;
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vkGetPhysicalDeviceQueueFamilyProperties(physical, &count, families.data());
  constexpr VkQueueFlags kBoth = VK_QUEUE_GRAPHICS_BIT | VK_QUEUE_COMPUTE_BIT;
  for (uint32_t f = 0; f < count; ++f) {
    VkBool32 presents = VK_TRUE;
    if (surface_ != VK_NULL_HANDLE) {
      LL_VK_RETURN_IF_ERROR("vkGetPhysicalDeviceSurfaceSupportKHR",
                            vkGetPhysicalDeviceSurfaceSupportKHR(physical, f, surface_, &presents));
    }
    if (presents && (families[f].queueFlags & kBoth) == kBoth) return static_cast<int>(f);
  }
  return -1;
}

absl::Status Gpu::choose_device() {
  uint32_t count = 0;
  LL_VK_RETURN_IF_ERROR("vkEnumeratePhysicalDevices", vkEnumeratePhysicalDevices(instance_, &count, nullptr));
  std::vector<VkPhysicalDevice> devices(count);
  if (count > 0) {
    LL_VK_RETURN_IF_ERROR("vkEnumeratePhysicalDevices", vkEnumeratePhysicalDevices(instance_, &count, devices.data()));
  }
  for (const VkPhysicalDevice physical : devices) {
    VkPhysicalDeviceProperties properties;
    vkGetPhysicalDeviceProperties(physical, &properties);
    LL_ASSIGN_OR_RETURN(const int family, usable_family(physical));
    if (family < 0 || properties.apiVersion < VK_API_VERSION_1_3) continue;
    if (physical_ != VK_NULL_HANDLE && rank(properties.deviceType) >= rank(properties_.deviceType)) continue;
    physical_ = physical;
    properties_ = properties;
    family_ = static_cast<uint32_t>(family);
  }
  if (physical_ == VK_NULL_HANDLE) {
    if (surface_ != VK_NULL_HANDLE) {
      return absl::NotFoundError(
          "no Vulkan 1.3 device can show pictures on this display; install a driver (mesa-vulkan-drivers has a "
          "software "
          "one), check VK_ICD_FILENAMES, or use lightloom render");
    }
    return absl::NotFoundError(
        "no Vulkan 1.3 device that draws among " + std::to_string(count) +
        "; install a driver (mesa-vulkan-drivers has a software one), check VK_ICD_FILENAMES, or "
        "use --device cpu");
  }
  vkGetPhysicalDeviceMemoryProperties(physical_, &memory_);
  return absl::OkStatus();
}

absl::Status Gpu::create_device() {
  auto features =
      vulkan_struct<VkPhysicalDeviceVulkan13Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_3_FEATURES);
  features.dynamicRendering = VK_TRUE;
  features.synchronization2 = VK_TRUE;
  const float priority = 1;
  auto queue = vulkan_struct<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue.queueFamilyIndex = family_;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;
  auto info = vulkan_struct<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  info.pNext = &features;
  info.queueCreateInfoCount = 1;
  info.pQueueCreateInfos = &queue;
  const char* const swapchain = VK_KHR_SWAPCHAIN_EXTENSION_NAME;
  info.enabledExtensionCount = surface_ != VK_NULL_HANDLE ? 1 : 0;
  info.ppEnabledExtensionNames = &swapchain;
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

Gpu::~Gpu() {
  if (device_ != VK_NULL_HANDLE) {
    vkDestroyFence(device_, fence_, nullptr);
    vkDestroyCommandPool(device_, pool_, nullptr);
    vkDestroyDevice(device_, nullptr);
  }
  if (surface_ != VK_NULL_HANDLE) vkDestroySurfaceKHR(instance_, surface_, nullptr);
  if (messenger_ != VK_NULL_HANDLE) {
    const auto destroy = reinterpret_cast<PFN_vkDestroyDebugUtilsMessengerEXT>(
        vkGetInstanceProcAddr(instance_, "vkDestroyDebugUtilsMessengerEXT"));
    destroy(instance_, messenger_, nullptr);
  }
  if (instance_ != VK_NULL_HANDLE) vkDestroyInstance(instance_, nullptr);
}

absl::Status Gpu::validation() const {
  return messages_->empty() ? absl::OkStatus() : absl::InternalError("Vulkan validation: " + messages_->front());
}

absl::Status Gpu::run(const std::function<absl::Status(VkCommandBuffer)>& record, const Semaphores& semaphores) {
  auto begin = vulkan_struct<VkCommandBufferBeginInfo>(VK_STRUCTURE_TYPE_COMMAND_BUFFER_BEGIN_INFO);
  begin.flags = VK_COMMAND_BUFFER_USAGE_ONE_TIME_SUBMIT_BIT;
  LL_VK_RETURN_IF_ERROR("vkBeginCommandBuffer", vkBeginCommandBuffer(commands_, &begin));
  if (absl::Status recorded = record(commands_); !recorded.ok()) {
    vkResetCommandBuffer(commands_, 0);
    return recorded;
  }
  LL_VK_RETURN_IF_ERROR("vkEndCommandBuffer", vkEndCommandBuffer(commands_));
  auto submit = vulkan_struct<VkSubmitInfo>(VK_STRUCTURE_TYPE_SUBMIT_INFO);
  submit.commandBufferCount = 1;
  submit.pCommandBuffers = &commands_;
  const VkPipelineStageFlags copies = VK_PIPELINE_STAGE_TRANSFER_BIT;
  submit.waitSemaphoreCount = semaphores.wait != VK_NULL_HANDLE ? 1 : 0;
  submit.pWaitSemaphores = &semaphores.wait;
  submit.pWaitDstStageMask = &copies;
  submit.signalSemaphoreCount = semaphores.signal != VK_NULL_HANDLE ? 1 : 0;
  submit.pSignalSemaphores = &semaphores.signal;
  LL_VK_RETURN_IF_ERROR("vkQueueSubmit", vkQueueSubmit(queue_, 1, &submit, fence_));
  LL_VK_RETURN_IF_ERROR("vkWaitForFences", vkWaitForFences(device_, 1, &fence_, VK_TRUE, UINT64_MAX));
  LL_VK_RETURN_IF_ERROR("vkResetFences", vkResetFences(device_, 1, &fence_));
  return validation();
}

absl::StatusOr<Owned<VkDeviceMemory>> Gpu::allocate(const VkMemoryRequirements& need, bool host) const {
  constexpr VkMemoryPropertyFlags kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT;
  constexpr VkMemoryPropertyFlags kDevice = VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT;
  const VkMemoryPropertyFlags wanted = host ? kHost : kDevice;
  auto info = vulkan_struct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  info.allocationSize = need.size;
  for (uint32_t type = 0; type < memory_.memoryTypeCount; ++type) {
    if ((need.memoryTypeBits >> type & 1) == 0) continue;
    if ((memory_.memoryTypes[type].propertyFlags & wanted) != wanted) continue;
    info.memoryTypeIndex = type;
    VkDeviceMemory memory = VK_NULL_HANDLE;
    LL_VK_RETURN_IF_ERROR("vkAllocateMemory", vkAllocateMemory(device_, &info, nullptr, &memory));
    return Owned<VkDeviceMemory>(device_, memory, vkFreeMemory);
  }
  return absl::NotFoundError("the Vulkan device has no fitting memory; use another device or --device cpu");
}

absl::StatusOr<Buffer> Gpu::buffer(uint64_t bytes, VkBufferUsageFlags usage, bool host) const {
  Buffer buffer;
  buffer.bytes = std::max<uint64_t>(bytes, 16);
  auto info = vulkan_struct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  info.size = buffer.bytes;
  info.usage = usage;
  VkBuffer handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateBuffer", vkCreateBuffer(device_, &info, nullptr, &handle));
  buffer.handle = {device_, handle, vkDestroyBuffer};
  VkMemoryRequirements need;
  vkGetBufferMemoryRequirements(device_, handle, &need);
  LL_ASSIGN_OR_RETURN(buffer.memory, allocate(need, host));
  LL_VK_RETURN_IF_ERROR("vkBindBufferMemory", vkBindBufferMemory(device_, handle, buffer.memory.get(), 0));
  return buffer;
}

absl::StatusOr<Buffer> Gpu::host_buffer(uint64_t bytes, VkBufferUsageFlags usage) const {
  LL_ASSIGN_OR_RETURN(Buffer host, buffer(bytes, usage, /*host=*/true));
  LL_VK_RETURN_IF_ERROR("vkMapMemory", vkMapMemory(device_, host.memory.get(), 0, VK_WHOLE_SIZE, 0, &host.mapped));
  return host;
}

absl::StatusOr<Buffer> Gpu::device_buffer(std::span<const uint8_t> data, VkBufferUsageFlags usage) {
  LL_ASSIGN_OR_RETURN(const Buffer staging, host_buffer(data.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT));
  std::copy(data.begin(), data.end(), static_cast<uint8_t*>(staging.mapped));

  LL_ASSIGN_OR_RETURN(Buffer out, buffer(staging.bytes, usage | VK_BUFFER_USAGE_TRANSFER_DST_BIT, /*host=*/false));
  LL_RETURN_IF_ERROR(run([&](VkCommandBuffer commands) {
    const VkBufferCopy all{0, 0, out.bytes};
    vkCmdCopyBuffer(commands, staging.handle.get(), out.handle.get(), 1, &all);
    after_copies(commands);
    return absl::OkStatus();
  }));
  return out;
}

absl::StatusOr<Texture2D> Gpu::texture(const TextureInfo& info) const {
  const uint32_t limit = limits().maxImageDimension2D;
  if (info.width > limit || info.height > limit || info.layers > limits().maxImageArrayLayers) {
    return absl::OutOfRangeError("an image of " + std::to_string(info.width) + "×" + std::to_string(info.height) +
                                 " with " + std::to_string(info.layers) +
                                 " layers is too large for this Vulkan device; choose a smaller --width or --samples");
  }
  Texture2D texture;
  texture.format = info.format;
  texture.width = info.width;
  texture.height = info.height;
  texture.layers = info.layers;
  texture.levels = info.levels;
  auto image = vulkan_struct<VkImageCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO);
  image.imageType = VK_IMAGE_TYPE_2D;
  image.format = info.format;
  image.extent = {info.width, info.height, 1};
  image.mipLevels = info.levels;
  image.arrayLayers = info.layers;
  image.samples = VK_SAMPLE_COUNT_1_BIT;
  image.usage = info.usage;
  VkImage handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateImage", vkCreateImage(device_, &image, nullptr, &handle));
  texture.handle = {device_, handle, vkDestroyImage};
  VkMemoryRequirements need;
  vkGetImageMemoryRequirements(device_, handle, &need);
  LL_ASSIGN_OR_RETURN(texture.memory, allocate(need, false));
  LL_VK_RETURN_IF_ERROR("vkBindImageMemory", vkBindImageMemory(device_, handle, texture.memory.get(), 0));
  auto view = vulkan_struct<VkImageViewCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO);
  view.image = handle;
  view.viewType = info.array ? VK_IMAGE_VIEW_TYPE_2D_ARRAY : VK_IMAGE_VIEW_TYPE_2D;
  view.format = info.format;
  view.subresourceRange = {info.aspect, 0, info.levels, 0, info.layers};
  VkImageView view_handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateImageView", vkCreateImageView(device_, &view, nullptr, &view_handle));
  texture.view = {device_, view_handle, vkDestroyImageView};
  return texture;
}

absl::Status Gpu::fill(const Texture2D& texture, std::span<const uint8_t> texels) {
  LL_ASSIGN_OR_RETURN(const Buffer staging, host_buffer(texels.size(), VK_BUFFER_USAGE_TRANSFER_SRC_BIT));
  std::copy(texels.begin(), texels.end(), static_cast<uint8_t*>(staging.mapped));
  return run([&](VkCommandBuffer commands) {
    transition(commands, texture.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kNoUse, kCopyTarget);
    VkBufferImageCopy region{};
    region.imageSubresource = level_of(texture, 0);
    region.imageExtent = {texture.width, texture.height, 1};
    vkCmdCopyBufferToImage(commands, staging.handle.get(), texture.handle.get(), kCopyTarget.layout, 1, &region);
    make_levels(commands, texture);
    return absl::OkStatus();
  });
}

void transition(VkCommandBuffer commands, VkImage image, VkImageAspectFlags aspect, Use from, Use to, uint32_t level,
                uint32_t count) {
  auto barrier = vulkan_struct<VkImageMemoryBarrier2>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER_2);
  barrier.srcStageMask = from.stages;
  barrier.srcAccessMask = from.access;
  barrier.dstStageMask = to.stages;
  barrier.dstAccessMask = to.access;
  barrier.oldLayout = from.layout;
  barrier.newLayout = to.layout;
  barrier.srcQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.dstQueueFamilyIndex = VK_QUEUE_FAMILY_IGNORED;
  barrier.image = image;
  barrier.subresourceRange = {aspect, level, count, 0, VK_REMAINING_ARRAY_LAYERS};
  auto dependency = vulkan_struct<VkDependencyInfo>(VK_STRUCTURE_TYPE_DEPENDENCY_INFO);
  dependency.imageMemoryBarrierCount = 1;
  dependency.pImageMemoryBarriers = &barrier;
  vkCmdPipelineBarrier2(commands, &dependency);
}

void after_copies(VkCommandBuffer commands) {
  auto barrier = vulkan_struct<VkMemoryBarrier2>(VK_STRUCTURE_TYPE_MEMORY_BARRIER_2);
  barrier.srcStageMask = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;
  barrier.srcAccessMask = VK_ACCESS_2_TRANSFER_WRITE_BIT;
  barrier.dstStageMask = VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_2_HOST_BIT;
  barrier.dstAccessMask = VK_ACCESS_2_MEMORY_READ_BIT | VK_ACCESS_2_HOST_READ_BIT;
  auto dependency = vulkan_struct<VkDependencyInfo>(VK_STRUCTURE_TYPE_DEPENDENCY_INFO);
  dependency.memoryBarrierCount = 1;
  dependency.pMemoryBarriers = &barrier;
  vkCmdPipelineBarrier2(commands, &dependency);
}

}  // namespace lightloom::renderer
