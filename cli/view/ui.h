// Dear ImGui on a window and a picture: what panel.cpp says is drawn over the picture.
#pragma once

#include <memory>

#include "runtime/renderer/gpu.h"

struct GLFWwindow;

namespace lightloom::view {

/// At most one at a time, in the thread of the window.
class Ui {
 public:
  /// `format` of the pictures. Both must outlive this.
  static absl::StatusOr<std::unique_ptr<Ui>> create(GLFWwindow* window, renderer::Gpu* gpu, VkFormat format);
  ~Ui();
  Ui(const Ui&) = delete;
  Ui& operator=(const Ui&) = delete;

  /// The picture to draw on. Nothing recorded may be running.
  absl::Status set_picture(const renderer::Texture2D& picture);
  /// ImGui's calls may follow.
  void begin();
  void end();
  /// What was said between begin() and end(). The picture is and stays kColour.
  absl::Status record(VkCommandBuffer commands);

 private:
  Ui() = default;
  absl::Status start(GLFWwindow* window, renderer::Gpu* gpu, VkFormat format);

  VkDevice device_ = VK_NULL_HANDLE;
  renderer::Owned<VkRenderPass> pass_;
  renderer::Owned<VkDescriptorPool> pool_;
  renderer::Owned<VkFramebuffer> frame_;
  VkImage picture_ = VK_NULL_HANDLE;
  VkExtent2D extent_{};
  bool window_started_ = false, vulkan_started_ = false;
};

}  // namespace lightloom::view
