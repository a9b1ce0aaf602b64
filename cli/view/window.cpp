#include "cli/view/window.h"

#include <vulkan/vulkan.h>
// After Vulkan, whose types it then takes.
#include <GLFW/glfw3.h>

#include <algorithm>

#include "core/base/stopwatch.h"
#include "runtime/renderer/status.h"

namespace lightloom::view {
namespace {

constexpr double kIdleSeconds = 0.1;

Window* itself(GLFWwindow* window) { return static_cast<Window*>(glfwGetWindowUserPointer(window)); }

}  // namespace

absl::StatusOr<std::unique_ptr<Window>> Window::create(const std::string& title, int width, int height) {
  std::unique_ptr<Window> out(new Window);
  out->started_ = glfwInit() == GLFW_TRUE;
  if (!out->started_) return absl::UnavailableError("no display: set DISPLAY, or use lightloom render");
  if (glfwVulkanSupported() != GLFW_TRUE) {
    return absl::NotFoundError(
        "no Vulkan driver can show pictures on this display; install one (mesa-vulkan-drivers), or "
        "use lightloom render");
  }
  glfwWindowHint(GLFW_CLIENT_API, GLFW_NO_API);
  out->window_ = glfwCreateWindow(width, height, title.c_str(), nullptr, nullptr);
  if (!out->window_) {
    const char* why = nullptr;
    glfwGetError(&why);
    return absl::UnavailableError(std::string("cannot open a window: ") + (why ? why : "no reason given") +
                                  "; check DISPLAY, or use lightloom render");
  }
  // ImGui's own callbacks, which come later, call these.
  glfwSetWindowUserPointer(out->window_, out.get());
  glfwSetKeyCallback(out->window_, on_key);
  glfwSetCursorPosCallback(out->window_, on_cursor);
  glfwSetMouseButtonCallback(out->window_, on_button);
  return out;
}

Window::~Window() {
  if (window_) glfwDestroyWindow(window_);
  if (started_) glfwTerminate();
}

renderer::WindowSystem Window::system() const {
  renderer::WindowSystem system;
  uint32_t count = 0;
  const char** extensions = glfwGetRequiredInstanceExtensions(&count);
  system.instance_extensions.assign(extensions, extensions + count);
  system.make_surface = [this](VkInstance instance) -> absl::StatusOr<VkSurfaceKHR> {
    VkSurfaceKHR surface = VK_NULL_HANDLE;
    LL_VK_RETURN_IF_ERROR("glfwCreateWindowSurface", glfwCreateWindowSurface(instance, window_, nullptr, &surface));
    return surface;
  };
  return system;
}

void Window::on_key(GLFWwindow* window, int key, int, int action, int) {
  if (action == GLFW_PRESS) itself(window)->events_.keys.push_back(key);
}

void Window::on_cursor(GLFWwindow* window, double x, double y) {
  itself(window)->cursor_ = {static_cast<float>(x), static_cast<float>(y)};
}

void Window::on_button(GLFWwindow* window, int button, int action, int) {
  Window* const self = itself(window);
  if (action == GLFW_PRESS && button == GLFW_MOUSE_BUTTON_LEFT) self->events_.left_press = self->cursor_;
}

bool Window::poll(bool idle) {
  events_ = {};
  if (!idle) {
    glfwPollEvents();
    return true;
  }
  const Stopwatch watch;
  glfwWaitEventsTimeout(kIdleSeconds);
  return watch.seconds() < 0.9 * kIdleSeconds;
}

bool Window::closed() const { return glfwWindowShouldClose(window_) == GLFW_TRUE; }
void Window::close() const { glfwSetWindowShouldClose(window_, GLFW_TRUE); }

VkExtent2D Window::size() const {
  int width = 0, height = 0;
  glfwGetFramebufferSize(window_, &width, &height);
  if (glfwGetWindowAttrib(window_, GLFW_ICONIFIED) == GLFW_TRUE) width = height = 0;
  return {static_cast<uint32_t>(std::max(0, width)), static_cast<uint32_t>(std::max(0, height))};
}

void Window::resize(int width, int height) const { glfwSetWindowSize(window_, width, height); }
void Window::set_title(const std::string& title) const { glfwSetWindowTitle(window_, title.c_str()); }

}  // namespace lightloom::view
