// The images that a window shows. What they are to show is drawn into a picture of the same size elsewhere and copied,
// bits as they are: so it does not depend on which formats a window has, and can be read back.
#pragma once

#include <optional>
#include <vector>

#include "runtime/renderer/gpu.h"

namespace lightloom::renderer {

class Swapchain {
 public:
  /// For the window that `gpu` was made with, which must outlive this. Without images until resize().
  static absl::StatusOr<Swapchain> create(const Gpu* gpu);
  Swapchain(Swapchain&&) = default;
  Swapchain& operator=(Swapchain&&) = delete;
  /// Waits until nothing is presented any more.
  ~Swapchain();

  /// Of pictures that record_copy() takes: 8 bits, encoded as sRGB by whoever draws them.
  VkFormat picture_format() const { return picture_format_; }
  VkExtent2D extent() const { return extent_; }

  /// New images for a window of that many pixels. False: it has no area now, there are none. Nothing may be running.
  absl::StatusOr<bool> resize(uint32_t width, uint32_t height);
  /// The image to fill next. None: it is out of date, resize().
  absl::StatusOr<std::optional<uint32_t>> acquire();
  /// `picture` is kColour and becomes kCopySource. For a run() with semaphores(image).
  void record_copy(VkCommandBuffer commands, const Texture2D& picture, uint32_t image) const;
  Semaphores semaphores(uint32_t image) const { return {acquired_.get(), drawn_[image].get()}; }
  /// After that run(). False: out of date, resize().
  absl::StatusOr<bool> present(uint32_t image) const;

 private:
  Swapchain() = default;

  const Gpu* gpu_ = nullptr;
  VkSurfaceFormatKHR format_{};
  VkFormat picture_format_ = VK_FORMAT_UNDEFINED;
  VkExtent2D extent_{};
  Owned<VkSwapchainKHR> chain_;
  std::vector<VkImage> images_;
  Owned<VkSemaphore> acquired_;
  std::vector<Owned<VkSemaphore>> drawn_;  ///< per image
};

}  // namespace lightloom::renderer
