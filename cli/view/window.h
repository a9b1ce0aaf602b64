// A window of the desktop.
#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "core/base/vec.h"
#include "runtime/renderer/gpu.h"

struct GLFWwindow;

namespace lightloom::view {

/// What a poll() has seen, however short it was: ImGui only sees how things are once a frame.
struct Events {
  std::vector<int> keys;           ///< that went down, GLFW's numbers
  std::optional<Vec2> left_press;  ///< where the left button went down, in the window's own coordinates
};

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

  /// Takes in what happened. `idle`: waits a while for something to happen; false if nothing did.
  bool poll(bool idle);
  /// Of the last poll().
  const Events& events() const { return events_; }
  bool closed() const;
  void close() const;
  /// Pixels; both 0 while it is minimised.
  VkExtent2D size() const;
  void resize(int width, int height) const;
  void set_title(const std::string& title) const;

 private:
  Window() = default;
  static void on_key(GLFWwindow* window, int key, int scancode, int action, int modifiers);
  static void on_cursor(GLFWwindow* window, double x, double y);
  static void on_button(GLFWwindow* window, int button, int action, int modifiers);

  bool started_ = false;
  GLFWwindow* window_ = nullptr;
  Events events_;
  Vec2 cursor_;
};

}  // namespace lightloom::view
