// Storage buffers in few big allocations, and copies between them and the host.
#pragma once

#include <vulkan/vulkan.h>

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/vulkan/device.h"

namespace lightloom {

/// Owned by its arena.
struct Buffer {
  VkBuffer handle = VK_NULL_HANDLE;
  uint64_t size = 0;  ///< bytes
  VkDeviceMemory memory = VK_NULL_HANDLE;
  uint64_t memory_offset = 0, memory_size = 0;  ///< where it lies, and the size of the whole allocation
  uint8_t* mapped = nullptr;                    ///< null: the host must copy through staging
  bool coherent = false, cached = false;
};

enum class MemoryUse {
  kDevice,          ///< device local; mapped if the device's memory happens to be host visible
  kDeviceUnmapped,  ///< never mapped
  kStaging,         ///< host visible, cached where there is such a type
};

/// Allocates memory in blocks and buffers within them; all are freed together, with the arena.
class Arena {
 public:
  Arena(Device* device, MemoryUse use) : device_(device), use_(use) {}
  ~Arena();
  Arena(const Arena&) = delete;
  Arena& operator=(const Arena&) = delete;

  /// A storage buffer that can be copied from and to. ResourceExhausted; Unimplemented if it exceeds what a
  /// shader can bind.
  absl::StatusOr<Buffer> buffer(uint64_t size);
  /// Sum of the buffers, without the slack of the blocks.
  uint64_t bytes() const { return bytes_; }

 private:
  struct Block {
    VkDeviceMemory memory;
    uint64_t size, used;
    uint32_t type;
    uint8_t* mapped;
  };
  absl::StatusOr<Block*> block_for(const VkMemoryRequirements& need);

  Device* device_;
  MemoryUse use_;
  uint64_t bytes_ = 0;
  std::vector<Block> blocks_;
  std::vector<VkBuffer> buffers_;
};

/// Copies that are finished when the call returns.
class Transfer {
 public:
  static absl::StatusOr<std::unique_ptr<Transfer>> create(Device* device);

  absl::Status upload(const Buffer& to, std::span<const uint8_t> bytes);
  absl::Status download(const Buffer& from, std::span<uint8_t> bytes);
  absl::Status clear(const Buffer& buffer);

 private:
  explicit Transfer(Device* device) : device_(device), arena_(device, MemoryUse::kStaging) {}

  Device* device_;
  Arena arena_;
  Buffer staging_;
};

}  // namespace lightloom
