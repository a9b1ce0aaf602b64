// Vulkan's structures, and its errors as absl::Status. lightloom.cpp says which status code becomes which
// lightloom_result.
#pragma once

#include <vulkan/vulkan_core.h>

#include <string>

#include "core/base/status.h"

namespace lightloom {

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
    case VK_ERROR_TOO_MANY_OBJECTS:
      return absl::ResourceExhaustedError(message + ": out of memory; unload something, or bake a smaller asset");
    case VK_ERROR_DEVICE_LOST:
      return absl::UnavailableError(message + ": the device is lost; destroy the runtime and create another");
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

}  // namespace lightloom

#define LL_VK_RETURN_IF_ERROR(what, call) LL_RETURN_IF_ERROR(::lightloom::vulkan_status((call), what))
