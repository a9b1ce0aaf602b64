// The engine's side of Vulkan: an instance, a device with one graphics and compute queue, and what is made on it. Errors
// of the validation layers become errors of the next run().
#pragma once

#include <vulkan/vulkan.h>

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "core/base/status.h"

namespace lightloom::renderer {

/// A Vulkan object that is destroyed with its owner.
template <class T>
class Owned {
 public:
  using Destroy = void (*)(VkDevice, T, const VkAllocationCallbacks*);

  Owned() = default;
  Owned(VkDevice device, T handle, Destroy destroy) : device_(device), handle_(handle), destroy_(destroy) {}
  Owned(Owned&& other) noexcept { swap(other); }
  Owned& operator=(Owned&& other) noexcept {
    Owned moved(std::move(other));
    swap(moved);
    return *this;
  }
  ~Owned() {
    if (handle_ != VK_NULL_HANDLE) destroy_(device_, handle_, nullptr);
  }
  T get() const { return handle_; }

 private:
  void swap(Owned& other) {
    std::swap(device_, other.device_);
    std::swap(handle_, other.handle_);
    std::swap(destroy_, other.destroy_);
  }
  VkDevice device_ = VK_NULL_HANDLE;
  T handle_ = VK_NULL_HANDLE;
  Destroy destroy_ = nullptr;
};

struct Buffer {
  Owned<VkDeviceMemory> memory;
  Owned<VkBuffer> handle;
  uint64_t bytes = 0;
  void* mapped = nullptr;  ///< null: only the device sees it
};

/// 2D, or a 2D array; `view` shows all of it as its shaders see it.
struct Texture2D {
  Owned<VkDeviceMemory> memory;
  Owned<VkImage> handle;
  Owned<VkImageView> view;
  VkFormat format = VK_FORMAT_UNDEFINED;
  uint32_t width = 0, height = 0, layers = 1, levels = 1;
};

struct TextureInfo {
  VkFormat format = VK_FORMAT_UNDEFINED;
  uint32_t width = 1, height = 1, layers = 1, levels = 1;
  bool array = false;  ///< viewed as an array even with one layer
  VkImageUsageFlags usage = 0;
  VkImageAspectFlags aspect = VK_IMAGE_ASPECT_COLOR_BIT;
};

/// A window to show pictures in.
struct WindowSystem {
  std::vector<const char*> instance_extensions;
  std::function<absl::StatusOr<VkSurfaceKHR>(VkInstance)> make_surface;
};

/// What a submission waits for and signals, besides the fence that run() waits for.
struct Semaphores {
  VkSemaphore wait = VK_NULL_HANDLE;  ///< before copies
  VkSemaphore signal = VK_NULL_HANDLE;
};

class Gpu {
 public:
  /// NotFound: no Vulkan 1.3 device with a graphics queue. `messages` takes what the validation layers say, also while
  /// this is destroyed; it must outlive this. Null: a list of its own. `window`: the device can present to it.
  static absl::StatusOr<std::unique_ptr<Gpu>> create(bool validation, std::vector<std::string>* messages = nullptr,
                                                     const WindowSystem* window = nullptr);
  ~Gpu();
  Gpu(const Gpu&) = delete;
  Gpu& operator=(const Gpu&) = delete;

  VkInstance instance() const { return instance_; }
  VkPhysicalDevice physical() const { return physical_; }
  VkDevice device() const { return device_; }
  VkQueue queue() const { return queue_; }
  uint32_t queue_family() const { return family_; }
  VkSurfaceKHR surface() const { return surface_; }  ///< null without a window
  const VkPhysicalDeviceLimits& limits() const { return properties_.limits; }

  /// Records commands, submits them and waits for them. Fails on any message of the validation layers.
  absl::Status run(const std::function<absl::Status(VkCommandBuffer)>& record, const Semaphores& semaphores = {});
  /// What the validation layers said so far.
  absl::Status validation() const;

  absl::StatusOr<Buffer> host_buffer(uint64_t bytes, VkBufferUsageFlags usage) const;
  /// Memory of the device's own, filled with `data`.
  absl::StatusOr<Buffer> device_buffer(std::span<const uint8_t> data, VkBufferUsageFlags usage);
  absl::StatusOr<Texture2D> texture(const TextureInfo& info) const;
  /// Fills level 0 of every layer, row after row and layer after layer, makes the levels below it, and leaves all
  /// of it to be sampled.
  absl::Status fill(const Texture2D& texture, std::span<const uint8_t> texels);

 private:
  Gpu() = default;
  absl::Status create_instance(bool validation, const WindowSystem* window);
  absl::StatusOr<int> usable_family(VkPhysicalDevice physical) const;
  absl::Status choose_device();
  absl::Status create_device();
  absl::StatusOr<Buffer> buffer(uint64_t bytes, VkBufferUsageFlags usage, bool host) const;
  absl::StatusOr<Owned<VkDeviceMemory>> allocate(const VkMemoryRequirements& need, bool host) const;

  std::vector<std::string> own_messages_;
  std::vector<std::string>* messages_ = &own_messages_;
  VkInstance instance_ = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger_ = VK_NULL_HANDLE;
  VkSurfaceKHR surface_ = VK_NULL_HANDLE;
  VkPhysicalDevice physical_ = VK_NULL_HANDLE;
  VkPhysicalDeviceProperties properties_{};
  VkPhysicalDeviceMemoryProperties memory_{};
  uint32_t family_ = 0;
  VkDevice device_ = VK_NULL_HANDLE;
  VkQueue queue_ = VK_NULL_HANDLE;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
};

/// Where an image is used: its layout there, the stages and what they do.
struct Use {
  VkImageLayout layout = VK_IMAGE_LAYOUT_UNDEFINED;
  VkPipelineStageFlags2 stages = 0;
  VkAccessFlags2 access = 0;
};
inline constexpr Use kNoUse{};
inline constexpr Use kSampled{VK_IMAGE_LAYOUT_SHADER_READ_ONLY_OPTIMAL,
                              VK_PIPELINE_STAGE_2_FRAGMENT_SHADER_BIT | VK_PIPELINE_STAGE_2_COMPUTE_SHADER_BIT,
                              VK_ACCESS_2_SHADER_SAMPLED_READ_BIT};
inline constexpr Use kColour{VK_IMAGE_LAYOUT_COLOR_ATTACHMENT_OPTIMAL, VK_PIPELINE_STAGE_2_COLOR_ATTACHMENT_OUTPUT_BIT,
                             VK_ACCESS_2_COLOR_ATTACHMENT_WRITE_BIT};
inline constexpr Use kDepth{
    VK_IMAGE_LAYOUT_DEPTH_ATTACHMENT_OPTIMAL,
    VK_PIPELINE_STAGE_2_EARLY_FRAGMENT_TESTS_BIT | VK_PIPELINE_STAGE_2_LATE_FRAGMENT_TESTS_BIT,
    VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_READ_BIT | VK_ACCESS_2_DEPTH_STENCIL_ATTACHMENT_WRITE_BIT};
inline constexpr Use kCopySource{VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
                                 VK_ACCESS_2_TRANSFER_READ_BIT};
inline constexpr Use kCopyTarget{VK_IMAGE_LAYOUT_TRANSFER_DST_OPTIMAL, VK_PIPELINE_STAGE_2_ALL_TRANSFER_BIT,
                                 VK_ACCESS_2_TRANSFER_WRITE_BIT};

/// What `from` did to `count` levels starting at `level` is done and visible before `to` begins.
void transition(VkCommandBuffer commands, VkImage image, VkImageAspectFlags aspect, Use from, Use to,
                uint32_t level = 0, uint32_t count = VK_REMAINING_MIP_LEVELS);
/// What copies wrote is visible to all that follows, the host included.
void after_copies(VkCommandBuffer commands);

/// The bytes of an array of plain values.
template <class T>
std::span<const uint8_t> bytes_of(const std::vector<T>& values) {
  return {reinterpret_cast<const uint8_t*>(values.data()), values.size() * sizeof(T)};
}

}  // namespace lightloom::renderer
