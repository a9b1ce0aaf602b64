// A window of the desktop.
#pragma once

#include <memory>
#include <string>

#include "runtime/renderer/gpu.h"

struct GLFWwindow;

namespace lightloom::view {

/// At most one at a time.
class Window {
 public:
  /// Unavailable: there is no display. NotFound: no Vulkan driver can show pictures on it.
  static absl::StatusOr<std::unique_ptr<Window>> create(const std::string& title, int width, int height);
  ~Window();
  Window(const Window&) = delete;
  Window& operator=(const Window&) = delete;

  /// For Gpu::create. Holds while this does.
  renderer::WindowSystem system() const;
  GLFWwindow* handle() const { return window_; }

  /// Takes in what happened; waits for something to happen if `idle`.
  void poll(bool idle) const;
  bool closed() const;
  void close() const;
  /// Pixels; both 0 while it is minimised.
  VkExtent2D size() const;
  void resize(int width, int height) const;
  void set_title(const std::string& title) const;

 private:
  Window() = default;

  bool started_ = false;
  GLFWwindow* window_ = nullptr;
};

}  // namespace lightloom::view
