#include "runtime/vulkan/buffer.h"

#include <algorithm>
#include <initializer_list>
#include <utility>

#include "runtime/boundary.h"

namespace lightloom {
namespace {

/// First memory type, in the device's order of preference, that has the most wanted of `wishes`.
int choose_type(const VkPhysicalDeviceMemoryProperties& memory, uint32_t allowed,
                std::initializer_list<VkMemoryPropertyFlags> wishes) {
  for (const VkMemoryPropertyFlags wish : wishes) {
    for (uint32_t t = 0; t < memory.memoryTypeCount; ++t) {
      if ((allowed >> t & 1u) != 0 && (memory.memoryTypes[t].propertyFlags & wish) == wish) return static_cast<int>(t);
    }
  }
  return -1;
}

absl::StatusOr<VkDeviceMemory> allocate(const Context& context, const VkMemoryRequirements& need, bool host,
                                        bool* coherent) {
  constexpr VkMemoryPropertyFlags kHost = VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT;
  const int type =
      host ? choose_type(context.memory, need.memoryTypeBits, {kHost | VK_MEMORY_PROPERTY_HOST_COHERENT_BIT, kHost})
           : choose_type(context.memory, need.memoryTypeBits, {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0});
  if (type < 0) return absl::OutOfRangeError("the device has no memory type for our buffers; choose another device");
  *coherent = (context.memory.memoryTypes[type].propertyFlags & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) != 0;
  auto info = vulkan_struct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  info.allocationSize = need.size;
  info.memoryTypeIndex = static_cast<uint32_t>(type);
  VkDeviceMemory memory = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkAllocateMemory",
                        context.vk.AllocateMemory(context.device, &info, context.callbacks, &memory));
  return memory;
}

absl::Status check_budget(const Context& context, uint64_t bytes) {
  if (context.budget == 0 || bytes <= context.budget - std::min(context.budget, context.bytes)) return absl::OkStatus();
  return over_budget("byte_budget of " + std::to_string(context.budget) + " has no room for " + std::to_string(bytes) +
                     " bytes beside " + std::to_string(context.bytes) + "; unload something or raise it");
}

}  // namespace

absl::StatusOr<Buffer> Buffer::create(Context* context, uint64_t size, BufferUse use) {
  size = std::max<uint64_t>(size, 16);
  if (use != BufferUse::kHost) LL_RETURN_IF_ERROR(check_budget(*context, size));
  if (size > context->limits.maxStorageBufferRange) {
    return absl::UnimplementedError("asset needs a buffer of " + std::to_string(size) +
                                    " bytes, this device binds at most " +
                                    std::to_string(context->limits.maxStorageBufferRange) + "; bake it coarser");
  }
  const VulkanTable& vk = context->vk;
  Buffer b;
  b.context_ = context;
  b.size_ = size;
  auto info = vulkan_struct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  info.size = size;
  info.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  if (use == BufferUse::kIndirect) info.usage |= VK_BUFFER_USAGE_INDIRECT_BUFFER_BIT;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  LL_VK_RETURN_IF_ERROR("vkCreateBuffer", vk.CreateBuffer(context->device, &info, context->callbacks, &b.handle_));
  VkMemoryRequirements need;
  vk.GetBufferMemoryRequirements(context->device, b.handle_, &need);
  b.memory_bytes_ = need.size;
  LL_ASSIGN_OR_RETURN(b.memory_, allocate(*context, need, use == BufferUse::kHost, &b.coherent_));
  LL_VK_RETURN_IF_ERROR("vkBindBufferMemory", vk.BindBufferMemory(context->device, b.handle_, b.memory_, 0));
  if (use == BufferUse::kHost) {
    void* mapped = nullptr;
    LL_VK_RETURN_IF_ERROR("vkMapMemory", vk.MapMemory(context->device, b.memory_, 0, VK_WHOLE_SIZE, 0, &mapped));
    b.mapped_ = static_cast<uint8_t*>(mapped);
  } else {
    b.counted_ = size;
    context->bytes += size;
  }
  return b;
}

Buffer& Buffer::operator=(Buffer&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(handle_, other.handle_);
  std::swap(memory_, other.memory_);
  std::swap(size_, other.size_);
  std::swap(memory_bytes_, other.memory_bytes_);
  std::swap(counted_, other.counted_);
  std::swap(mapped_, other.mapped_);
  std::swap(coherent_, other.coherent_);
  return *this;
}

void Buffer::reset() {
  if (context_ == nullptr) return;
  context_->vk.DestroyBuffer(context_->device, handle_, context_->callbacks);
  context_->vk.FreeMemory(context_->device, memory_, context_->callbacks);
  context_->bytes -= counted_;
  context_ = nullptr;
}

VkMappedMemoryRange Buffer::atoms(uint64_t offset, uint64_t bytes) const {
  const uint64_t atom = context_->limits.nonCoherentAtomSize;
  auto range = vulkan_struct<VkMappedMemoryRange>(VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE);
  range.memory = memory_;
  range.offset = offset / atom * atom;
  const uint64_t end = (offset + bytes + atom - 1) / atom * atom;
  range.size = std::min(end, memory_bytes_) - range.offset;
  return range;
}

absl::Status Buffer::flush(uint64_t offset, uint64_t bytes) const {
  if (coherent_ || bytes == 0) return absl::OkStatus();
  const VkMappedMemoryRange range = atoms(offset, bytes);
  return vulkan_status(context_->vk.FlushMappedMemoryRanges(context_->device, 1, &range), "vkFlushMappedMemoryRanges");
}

absl::Status Buffer::invalidate(uint64_t offset, uint64_t bytes) const {
  if (coherent_ || bytes == 0) return absl::OkStatus();
  const VkMappedMemoryRange range = atoms(offset, bytes);
  return vulkan_status(context_->vk.InvalidateMappedMemoryRanges(context_->device, 1, &range),
                       "vkInvalidateMappedMemoryRanges");
}

absl::StatusOr<DeviceImage> DeviceImage::create(Context* context, VkFormat format, uint32_t width, uint32_t height,
                                                uint32_t layers) {
  if (width > context->limits.maxImageDimension2D || height > context->limits.maxImageDimension2D) {
    return absl::UnimplementedError("lightmap of " + std::to_string(width) + " x " + std::to_string(height) +
                                    " texels, this device has images of at most " +
                                    std::to_string(context->limits.maxImageDimension2D) +
                                    "; bake it coarser or create without image_format");
  }
  const VulkanTable& vk = context->vk;
  DeviceImage image;
  image.context_ = context;
  auto info = vulkan_struct<VkImageCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_CREATE_INFO);
  info.imageType = VK_IMAGE_TYPE_2D;
  info.format = format;
  info.extent = {width, height, 1};
  info.mipLevels = 1;
  info.arrayLayers = layers;
  info.samples = VK_SAMPLE_COUNT_1_BIT;
  info.tiling = VK_IMAGE_TILING_OPTIMAL;
  info.usage = VK_IMAGE_USAGE_STORAGE_BIT | VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  info.initialLayout = VK_IMAGE_LAYOUT_UNDEFINED;
  LL_VK_RETURN_IF_ERROR("vkCreateImage", vk.CreateImage(context->device, &info, context->callbacks, &image.handle_));
  VkMemoryRequirements need;
  vk.GetImageMemoryRequirements(context->device, image.handle_, &need);
  LL_RETURN_IF_ERROR(check_budget(*context, need.size));
  bool coherent = false;
  LL_ASSIGN_OR_RETURN(image.memory_, allocate(*context, need, false, &coherent));
  image.counted_ = need.size;
  context->bytes += need.size;
  LL_VK_RETURN_IF_ERROR("vkBindImageMemory", vk.BindImageMemory(context->device, image.handle_, image.memory_, 0));

  auto view = vulkan_struct<VkImageViewCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO);
  view.image = image.handle_;
  view.viewType = VK_IMAGE_VIEW_TYPE_2D_ARRAY;
  view.format = format;
  view.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, layers};
  LL_VK_RETURN_IF_ERROR("vkCreateImageView",
                        vk.CreateImageView(context->device, &view, context->callbacks, &image.view_));
  return image;
}

DeviceImage& DeviceImage::operator=(DeviceImage&& other) noexcept {
  std::swap(context_, other.context_);
  std::swap(handle_, other.handle_);
  std::swap(view_, other.view_);
  std::swap(memory_, other.memory_);
  std::swap(counted_, other.counted_);
  return *this;
}

void DeviceImage::reset() {
  if (context_ == nullptr) return;
  context_->vk.DestroyImageView(context_->device, view_, context_->callbacks);
  context_->vk.DestroyImage(context_->device, handle_, context_->callbacks);
  context_->vk.FreeMemory(context_->device, memory_, context_->callbacks);
  context_->bytes -= counted_;
  context_ = nullptr;
}

}  // namespace lightloom
