#include "runtime/vulkan/buffer.h"

#include <algorithm>
#include <cstring>
#include <string>

#include "runtime/vulkan/status.h"

namespace lightloom {
namespace {

/// Larger buffers get a block of their own.
constexpr uint64_t kBlockBytes = 16ull << 20;
constexpr uint64_t kStagingBytes = 4ull << 20;

/// First memory type, in the device's order of preference, that has the most wanted of `wishes`.
int choose_type(const VkPhysicalDeviceMemoryProperties& memory, uint32_t allowed,
                std::initializer_list<VkMemoryPropertyFlags> wishes) {
  for (const VkMemoryPropertyFlags wish : wishes) {
    for (uint32_t t = 0; t < memory.memoryTypeCount; ++t) {
      if ((allowed >> t & 1u) != 0 && (memory.memoryTypes[t].propertyFlags & wish) == wish) {
        return static_cast<int>(t);
      }
    }
  }
  return -1;
}

/// The part of a buffer's allocation to flush or invalidate, widened to the device's atoms.
VkMappedMemoryRange atoms(const Buffer& b, uint64_t size, uint64_t atom) {
  auto range = vulkan_struct<VkMappedMemoryRange>(VK_STRUCTURE_TYPE_MAPPED_MEMORY_RANGE);
  range.memory = b.memory;
  range.offset = b.memory_offset / atom * atom;
  const uint64_t end = (b.memory_offset + size + atom - 1) / atom * atom;
  range.size = std::min(end, b.memory_size) - range.offset;
  return range;
}

absl::Status flush(Device* device, const Buffer& b, uint64_t size) {
  if (b.coherent) return absl::OkStatus();
  const auto range = atoms(b, size, device->limits().nonCoherentAtomSize);
  return vulkan_status(vkFlushMappedMemoryRanges(device->handle(), 1, &range), "vkFlushMappedMemoryRanges");
}

absl::Status invalidate(Device* device, const Buffer& b, uint64_t size) {
  if (b.coherent) return absl::OkStatus();
  const auto range = atoms(b, size, device->limits().nonCoherentAtomSize);
  return vulkan_status(vkInvalidateMappedMemoryRanges(device->handle(), 1, &range), "vkInvalidateMappedMemoryRanges");
}

}  // namespace

Arena::~Arena() {
  for (const VkBuffer b : buffers_) vkDestroyBuffer(device_->handle(), b, nullptr);
  for (const Block& b : blocks_) vkFreeMemory(device_->handle(), b.memory, nullptr);
}

absl::StatusOr<Buffer> Arena::buffer(uint64_t size) {
  size = std::max<uint64_t>(size, 16);
  if (size > device_->limits().maxStorageBufferRange) {
    return absl::UnimplementedError("asset needs a buffer of " + std::to_string(size) +
                                    " bytes, this device binds at most " +
                                    std::to_string(device_->limits().maxStorageBufferRange) + "; bake it coarser");
  }
  auto info = vulkan_struct<VkBufferCreateInfo>(VK_STRUCTURE_TYPE_BUFFER_CREATE_INFO);
  info.size = size;
  info.usage = VK_BUFFER_USAGE_STORAGE_BUFFER_BIT | VK_BUFFER_USAGE_TRANSFER_SRC_BIT | VK_BUFFER_USAGE_TRANSFER_DST_BIT;
  info.sharingMode = VK_SHARING_MODE_EXCLUSIVE;
  VkBuffer handle = VK_NULL_HANDLE;
  buffers_.reserve(buffers_.size() + 1);
  LL_VK_RETURN_IF_ERROR("vkCreateBuffer", vkCreateBuffer(device_->handle(), &info, nullptr, &handle));
  buffers_.push_back(handle);

  VkMemoryRequirements need;
  vkGetBufferMemoryRequirements(device_->handle(), handle, &need);
  LL_ASSIGN_OR_RETURN(Block* const block, block_for(need));
  const uint64_t offset = (block->used + need.alignment - 1) / need.alignment * need.alignment;
  LL_VK_RETURN_IF_ERROR("vkBindBufferMemory", vkBindBufferMemory(device_->handle(), handle, block->memory, offset));
  block->used = offset + need.size;
  bytes_ += need.size;

  const VkMemoryPropertyFlags flags = device_->memory().memoryTypes[block->type].propertyFlags;
  Buffer b;
  b.handle = handle;
  b.size = size;
  b.memory = block->memory;
  b.memory_offset = offset;
  b.memory_size = block->size;
  b.mapped = block->mapped == nullptr ? nullptr : block->mapped + offset;
  b.coherent = (flags & VK_MEMORY_PROPERTY_HOST_COHERENT_BIT) != 0;
  b.cached = (flags & VK_MEMORY_PROPERTY_HOST_CACHED_BIT) != 0;
  return b;
}

absl::StatusOr<Arena::Block*> Arena::block_for(const VkMemoryRequirements& need) {
  const int type = use_ == MemoryUse::kStaging
                       ? choose_type(device_->memory(), need.memoryTypeBits,
                                     {VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT | VK_MEMORY_PROPERTY_HOST_CACHED_BIT,
                                      VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT})
                       : choose_type(device_->memory(), need.memoryTypeBits, {VK_MEMORY_PROPERTY_DEVICE_LOCAL_BIT, 0});
  if (type < 0) return absl::OutOfRangeError("device has no memory type for storage buffers");
  for (Block& b : blocks_) {
    const uint64_t offset = (b.used + need.alignment - 1) / need.alignment * need.alignment;
    if (b.type == static_cast<uint32_t>(type) && offset + need.size <= b.size) return &b;
  }

  auto info = vulkan_struct<VkMemoryAllocateInfo>(VK_STRUCTURE_TYPE_MEMORY_ALLOCATE_INFO);
  info.memoryTypeIndex = static_cast<uint32_t>(type);
  // A staging arena holds one buffer.
  info.allocationSize = use_ == MemoryUse::kStaging ? need.size : std::max(need.size, kBlockBytes);
  Block block{VK_NULL_HANDLE, info.allocationSize, 0, info.memoryTypeIndex, nullptr};
  blocks_.reserve(blocks_.size() + 1);
  LL_VK_RETURN_IF_ERROR("vkAllocateMemory", vkAllocateMemory(device_->handle(), &info, nullptr, &block.memory));
  blocks_.push_back(block);
  const auto flags = device_->memory().memoryTypes[type].propertyFlags;
  if (use_ != MemoryUse::kDeviceUnmapped && (flags & VK_MEMORY_PROPERTY_HOST_VISIBLE_BIT) != 0) {
    void* mapped = nullptr;
    LL_VK_RETURN_IF_ERROR("vkMapMemory", vkMapMemory(device_->handle(), block.memory, 0, VK_WHOLE_SIZE, 0, &mapped));
    blocks_.back().mapped = static_cast<uint8_t*>(mapped);
  }
  return &blocks_.back();
}

absl::StatusOr<std::unique_ptr<Transfer>> Transfer::create(Device* device) {
  std::unique_ptr<Transfer> transfer(new Transfer(device));
  LL_ASSIGN_OR_RETURN(transfer->staging_, transfer->arena_.buffer(kStagingBytes));
  // Staging is always flushed and invalidated, so that this path is the same everywhere.
  transfer->staging_.coherent = false;
  return transfer;
}

absl::Status Transfer::upload(const Buffer& to, std::span<const uint8_t> bytes) {
  if (bytes.empty()) return absl::OkStatus();
  if (to.mapped != nullptr) {
    std::memcpy(to.mapped, bytes.data(), bytes.size());
    return flush(device_, to, bytes.size());
  }
  for (uint64_t at = 0; at < bytes.size(); at += staging_.size) {
    const auto part = bytes.subspan(at, std::min<uint64_t>(staging_.size, bytes.size() - at));
    std::memcpy(staging_.mapped, part.data(), part.size());
    LL_RETURN_IF_ERROR(flush(device_, staging_, part.size()));
    LL_RETURN_IF_ERROR(device_->run([&](VkCommandBuffer commands) {
      const VkBufferCopy copy{0, at, part.size()};
      vkCmdCopyBuffer(commands, staging_.handle, to.handle, 1, &copy);
      barrier_to_all(commands);
    }));
  }
  return absl::OkStatus();
}

absl::Status Transfer::download(const Buffer& from, std::span<uint8_t> bytes) {
  if (bytes.empty()) return absl::OkStatus();
  if (from.mapped != nullptr && from.cached) {
    LL_RETURN_IF_ERROR(invalidate(device_, from, bytes.size()));
    std::memcpy(bytes.data(), from.mapped, bytes.size());
    return absl::OkStatus();
  }
  for (uint64_t at = 0; at < bytes.size(); at += staging_.size) {
    const auto part = bytes.subspan(at, std::min<uint64_t>(staging_.size, bytes.size() - at));
    LL_RETURN_IF_ERROR(device_->run([&](VkCommandBuffer commands) {
      const VkBufferCopy copy{at, 0, part.size()};
      vkCmdCopyBuffer(commands, from.handle, staging_.handle, 1, &copy);
      barrier_to_all(commands);
    }));
    LL_RETURN_IF_ERROR(invalidate(device_, staging_, part.size()));
    std::memcpy(part.data(), staging_.mapped, part.size());
  }
  return absl::OkStatus();
}

absl::Status Transfer::clear(const Buffer& buffer) {
  return device_->run([&](VkCommandBuffer commands) {
    vkCmdFillBuffer(commands, buffer.handle, 0, VK_WHOLE_SIZE, 0);
    barrier_to_all(commands);
  });
}

}  // namespace lightloom
