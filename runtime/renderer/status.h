// Vulkan's structures, and its errors as absl::Status.
#pragma once

#include <vulkan/vulkan.h>

#include <string>

#include "core/base/status.h"

namespace lightloom::renderer {

/// Zero but for its type.
template <class T>
T vulkan_struct(VkStructureType type) {
  T s{};
  s.sType = type;
  return s;
}

/// OK for VK_SUCCESS. `what` names the call.
inline absl::Status vulkan_status(VkResult result, const char* what) {
  if (result == VK_SUCCESS) return absl::OkStatus();
  const std::string message = std::string(what) + " failed with VkResult " + std::to_string(static_cast<int>(result));
  switch (result) {
    case VK_ERROR_OUT_OF_HOST_MEMORY:
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
      return absl::ResourceExhaustedError(message + ": out of memory; choose a smaller --width or --shadow-size");
    case VK_ERROR_DEVICE_LOST:
      return absl::UnavailableError(message + ": the device is lost; start again");
    case VK_ERROR_INCOMPATIBLE_DRIVER:
    case VK_ERROR_INITIALIZATION_FAILED:
      return absl::NotFoundError(message + ": no Vulkan driver works here; install one (mesa-vulkan-drivers)");
    case VK_ERROR_LAYER_NOT_PRESENT:
    case VK_ERROR_EXTENSION_NOT_PRESENT:
    case VK_ERROR_FEATURE_NOT_PRESENT:
      return absl::OutOfRangeError(message + ": a layer, extension or feature is missing");
    default:
      return absl::InternalError(message);
  }
}

}  // namespace lightloom::renderer

#define LL_VK_RETURN_IF_ERROR(what, call) LL_RETURN_IF_ERROR(::lightloom::renderer::vulkan_status((call), what))
