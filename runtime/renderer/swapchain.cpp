#include "runtime/renderer/swapchain.h"

#include <algorithm>

#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

constexpr Use kPresented{VK_IMAGE_LAYOUT_PRESENT_SRC_KHR, VK_PIPELINE_STAGE_2_ALL_COMMANDS_BIT, 0};

/// The format whose bits are the same, without the hardware's encoding.
VkFormat plain(VkFormat format) {
  switch (format) {
    case VK_FORMAT_B8G8R8A8_SRGB:
    case VK_FORMAT_B8G8R8A8_UNORM:
      return VK_FORMAT_B8G8R8A8_UNORM;
    case VK_FORMAT_R8G8B8A8_SRGB:
    case VK_FORMAT_R8G8B8A8_UNORM:
      return VK_FORMAT_R8G8B8A8_UNORM;
    default:
      return VK_FORMAT_UNDEFINED;
  }
}

absl::StatusOr<VkSurfaceFormatKHR> choose_format(const Gpu& gpu) {
  uint32_t count = 0;
  LL_VK_RETURN_IF_ERROR("vkGetPhysicalDeviceSurfaceFormatsKHR",
                        vkGetPhysicalDeviceSurfaceFormatsKHR(gpu.physical(), gpu.surface(), &count, nullptr));
  std::vector<VkSurfaceFormatKHR> formats(count);
  LL_VK_RETURN_IF_ERROR("vkGetPhysicalDeviceSurfaceFormatsKHR",
                        vkGetPhysicalDeviceSurfaceFormatsKHR(gpu.physical(), gpu.surface(), &count, formats.data()));
  for (const VkSurfaceFormatKHR& format : formats) {
    if (plain(format.format) != VK_FORMAT_UNDEFINED && format.colorSpace == VK_COLOR_SPACE_SRGB_NONLINEAR_KHR) {
      return format;
    }
  }
  return absl::NotFoundError(
      "this display takes no pictures of 8 bits per colour; use another one, or lightloom render");
}

absl::StatusOr<Owned<VkSemaphore>> semaphore(VkDevice device) {
  const auto info = vulkan_struct<VkSemaphoreCreateInfo>(VK_STRUCTURE_TYPE_SEMAPHORE_CREATE_INFO);
  VkSemaphore handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateSemaphore", vkCreateSemaphore(device, &info, nullptr, &handle));
  return Owned<VkSemaphore>(device, handle, vkDestroySemaphore);
}

}  // namespace

absl::StatusOr<Swapchain> Swapchain::create(const Gpu* gpu) {
  Swapchain s;
  s.gpu_ = gpu;
  LL_ASSIGN_OR_RETURN(s.format_, choose_format(*gpu));
  s.picture_format_ = plain(s.format_.format);
  return s;
}

Swapchain::~Swapchain() {
  if (chain_.get() != VK_NULL_HANDLE) vkDeviceWaitIdle(gpu_->device());
}

absl::StatusOr<bool> Swapchain::resize(uint32_t width, uint32_t height) {
  vkDeviceWaitIdle(gpu_->device());  // what is presented, too
  VkSurfaceCapabilitiesKHR can{};
  LL_VK_RETURN_IF_ERROR("vkGetPhysicalDeviceSurfaceCapabilitiesKHR",
                        vkGetPhysicalDeviceSurfaceCapabilitiesKHR(gpu_->physical(), gpu_->surface(), &can));
  if ((can.supportedUsageFlags & VK_IMAGE_USAGE_TRANSFER_DST_BIT) == 0) {
    return absl::NotFoundError("this display takes no copied pictures; use another one, or lightloom render");
  }
  extent_ = can.currentExtent;
  if (extent_.width == 0xffffffffu) {  // the window takes the size of its images
    extent_ = {std::clamp(width, can.minImageExtent.width, can.maxImageExtent.width),
               std::clamp(height, can.minImageExtent.height, can.maxImageExtent.height)};
  }
  images_.clear();
  if (extent_.width == 0 || extent_.height == 0) {
    chain_ = {};
    return false;
  }
  auto info = vulkan_struct<VkSwapchainCreateInfoKHR>(VK_STRUCTURE_TYPE_SWAPCHAIN_CREATE_INFO_KHR);
  info.surface = gpu_->surface();
  info.minImageCount = can.minImageCount + 1;
  if (can.maxImageCount > 0) info.minImageCount = std::min(info.minImageCount, can.maxImageCount);
  info.imageFormat = format_.format;
  info.imageColorSpace = format_.colorSpace;
  info.imageExtent = extent_;
  info.imageArrayLayers = 1;
  info.imageUsage = VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  info.preTransform = can.currentTransform;
  const bool opaque = (can.supportedCompositeAlpha & VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR) != 0;
  info.compositeAlpha = opaque ? VK_COMPOSITE_ALPHA_OPAQUE_BIT_KHR : VK_COMPOSITE_ALPHA_INHERIT_BIT_KHR;
  info.presentMode = VK_PRESENT_MODE_FIFO_KHR;
  info.clipped = VK_TRUE;
  info.oldSwapchain = chain_.get();
  VkSwapchainKHR chain = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateSwapchainKHR", vkCreateSwapchainKHR(gpu_->device(), &info, nullptr, &chain));
  chain_ = {gpu_->device(), chain, vkDestroySwapchainKHR};
  uint32_t count = 0;
  LL_VK_RETURN_IF_ERROR("vkGetSwapchainImagesKHR", vkGetSwapchainImagesKHR(gpu_->device(), chain, &count, nullptr));
  images_.resize(count);
  LL_VK_RETURN_IF_ERROR("vkGetSwapchainImagesKHR",
                        vkGetSwapchainImagesKHR(gpu_->device(), chain, &count, images_.data()));
  LL_ASSIGN_OR_RETURN(acquired_, semaphore(gpu_->device()));
  drawn_.clear();
  for (uint32_t i = 0; i < count; ++i) {
    LL_ASSIGN_OR_RETURN(Owned<VkSemaphore> drawn, semaphore(gpu_->device()));
    drawn_.push_back(std::move(drawn));
  }
  return true;
}

absl::StatusOr<std::optional<uint32_t>> Swapchain::acquire() {
  uint32_t image = 0;
  const VkResult result =
      vkAcquireNextImageKHR(gpu_->device(), chain_.get(), UINT64_MAX, acquired_.get(), VK_NULL_HANDLE, &image);
  if (result == VK_ERROR_OUT_OF_DATE_KHR) return std::optional<uint32_t>();
  // A suboptimal image is shown all the same: its semaphore will be signalled.
  if (result != VK_SUBOPTIMAL_KHR) LL_VK_RETURN_IF_ERROR("vkAcquireNextImageKHR", result);
  return std::optional<uint32_t>(image);
}

void Swapchain::record_copy(VkCommandBuffer commands, const Texture2D& picture, uint32_t image) const {
  transition(commands, picture.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kColour, kCopySource);
  Use before = kNoUse;
  before.stages = VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT;  // at which the semaphore is waited for
  transition(commands, images_[image], VK_IMAGE_ASPECT_COLOR_BIT, before, kCopyTarget);
  VkImageCopy region{};
  region.srcSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, 1};
  region.dstSubresource = region.srcSubresource;
  region.extent = {std::min(extent_.width, picture.width), std::min(extent_.height, picture.height), 1};
  vkCmdCopyImage(commands, picture.handle.get(), kCopySource.layout, images_[image], kCopyTarget.layout, 1, &region);
  transition(commands, images_[image], VK_IMAGE_ASPECT_COLOR_BIT, kCopyTarget, kPresented);
}

absl::StatusOr<bool> Swapchain::present(uint32_t image) const {
  const VkSwapchainKHR chain = chain_.get();
  const VkSemaphore drawn = drawn_[image].get();
  auto info = vulkan_struct<VkPresentInfoKHR>(VK_STRUCTURE_TYPE_PRESENT_INFO_KHR);
  info.waitSemaphoreCount = 1;
  info.pWaitSemaphores = &drawn;
  info.swapchainCount = 1;
  info.pSwapchains = &chain;
  info.pImageIndices = &image;
  const VkResult result = vkQueuePresentKHR(gpu_->queue(), &info);
  if (result == VK_ERROR_OUT_OF_DATE_KHR || result == VK_SUBOPTIMAL_KHR) return false;
  LL_VK_RETURN_IF_ERROR("vkQueuePresentKHR", result);
  return true;
}

}  // namespace lightloom::renderer
