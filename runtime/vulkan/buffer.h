// Buffers and images with memory of their own; pools are large, so there are few.
#pragma once

#include "runtime/vulkan/context.h"

namespace lightloom {

enum class BufferUse {
  kDevice,    ///< device local, storage and transfers; counted in Context::bytes
  kIndirect,  ///< as kDevice, and holds dispatch arguments
  kHost,      ///< mapped, storage and transfers
};

class Buffer {
 public:
  Buffer() = default;
  ~Buffer() { reset(); }
  Buffer(Buffer&& other) noexcept { *this = std::move(other); }
  Buffer& operator=(Buffer&& other) noexcept;

  /// ResourceExhausted; over_budget(); Unimplemented if it exceeds what a shader can bind. Size 0 makes one of 16 bytes.
  static absl::StatusOr<Buffer> create(Context* context, uint64_t size, BufferUse use);

  VkBuffer handle() const { return handle_; }
  uint64_t size() const { return size_; }
  bool exists() const { return handle_ != VK_NULL_HANDLE; }
  uint8_t* mapped() const { return mapped_; }  ///< kHost
  VkDescriptorBufferInfo whole() const { return {handle_, 0, VK_WHOLE_SIZE}; }

  /// What the host wrote reaches the device once it is submitted; what the device wrote reaches the host.
  absl::Status flush(uint64_t offset, uint64_t bytes) const;
  absl::Status invalidate(uint64_t offset, uint64_t bytes) const;

 private:
  void reset();
  VkMappedMemoryRange atoms(uint64_t offset, uint64_t bytes) const;

  Context* context_ = nullptr;
  VkBuffer handle_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  uint64_t size_ = 0, memory_bytes_ = 0, counted_ = 0;
  uint8_t* mapped_ = nullptr;
  bool coherent_ = true;
};

/// E as a 2D array image that shaders write and engines sample.
class DeviceImage {
 public:
  DeviceImage() = default;
  ~DeviceImage() { reset(); }
  DeviceImage(DeviceImage&& other) noexcept { *this = std::move(other); }
  DeviceImage& operator=(DeviceImage&& other) noexcept;

  static absl::StatusOr<DeviceImage> create(Context* context, VkFormat format, uint32_t width, uint32_t height,
                                            uint32_t layers);

  VkImage handle() const { return handle_; }
  VkImageView view() const { return view_; }

 private:
  void reset();

  Context* context_ = nullptr;
  VkImage handle_ = VK_NULL_HANDLE;
  VkImageView view_ = VK_NULL_HANDLE;
  VkDeviceMemory memory_ = VK_NULL_HANDLE;
  uint64_t counted_ = 0;
};

}  // namespace lightloom
