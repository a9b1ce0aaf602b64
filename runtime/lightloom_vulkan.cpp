// The functions of lightloom_vulkan.h, and lightloom_create, which makes a device first.
#include "runtime/include/lightloom_vulkan.h"

#include "runtime/boundary.h"
#include "runtime/simd_backend.h"
#include "runtime/vulkan/backend.h"

namespace lightloom {
namespace {

absl::Status check_create_info(const lightloom_vulkan_create_info& info) {
  if ((info.flags & ~static_cast<uint32_t>(LIGHTLOOM_CREATE_SMOOTHING)) != 0) {
    return absl::InvalidArgumentError("lightloom_vulkan_create_info has unknown flags");
  }
  if (info.instance == VK_NULL_HANDLE || info.physical_device == VK_NULL_HANDLE || info.device == VK_NULL_HANDLE ||
      info.get_instance_proc_addr == nullptr) {
    return absl::InvalidArgumentError(
        "lightloom_vulkan_create_info lacks an instance, a device or get_instance_proc_addr");
  }
  if (info.frames_in_flight < 1 || info.frames_in_flight > 8) {
    return absl::InvalidArgumentError("frames_in_flight must be 1 to 8");
  }
  if (info.workgroup_size != 0 && info.workgroup_size != 8 && info.workgroup_size != 16 && info.workgroup_size != 32 &&
      info.workgroup_size != 64) {
    return absl::InvalidArgumentError("workgroup_size must be 8, 16, 32, 64 or 0");
  }
  if (info.image_format != VK_FORMAT_UNDEFINED && info.image_format != VK_FORMAT_R16G16B16A16_SFLOAT &&
      info.image_format != VK_FORMAT_R32G32B32A32_SFLOAT) {
    return absl::InvalidArgumentError("image_format must be R16G16B16A16_SFLOAT or R32G32B32A32_SFLOAT");
  }
  if (info.max_lights > 65536 || info.max_shadow_views > 65536) {
    return absl::InvalidArgumentError("max_lights and max_shadow_views must be at most 65536");
  }
  return absl::OkStatus();
}

/// As with_asset(), for functions of lightloom_vulkan.h.
template <class Body>
lightloom_result with_vulkan_asset(lightloom_runtime* runtime, Body body) noexcept {
  return with_asset(runtime, [&](Backend& backend) -> absl::Status {
    auto* vulkan = dynamic_cast<VulkanBackend*>(&backend);
    if (vulkan == nullptr) return absl::InvalidArgumentError("this runtime has no Vulkan device");
    return body(*vulkan);
  });
}

lightloom_result create_on_cpu(const lightloom_create_info& info, lightloom_runtime** out) {
  return make_runtime(
      info.allocator, {info.message, info.message_user}, out, [&](lightloom_runtime* runtime) -> absl::Status {
        if ((info.flags & ~(LIGHTLOOM_CREATE_CPU | LIGHTLOOM_CREATE_SMOOTHING)) != 0 || info.reserved != 0) {
          return absl::InvalidArgumentError(
              "beside LIGHTLOOM_CREATE_CPU only LIGHTLOOM_CREATE_SMOOTHING may be set, and reserved must be 0");
        }
        runtime->backend = std::make_unique<SimdBackend>(
            SimdBackend::Options{info.threads, (info.flags & LIGHTLOOM_CREATE_SMOOTHING) != 0, info.byte_budget},
            &runtime->memory);
        return absl::OkStatus();
      });
}

}  // namespace
}  // namespace lightloom

using lightloom::guarded;

extern "C" {

lightloom_result lightloom_vulkan_check(const lightloom_vulkan_check_info* info,
                                        lightloom_vulkan_requirements* requirements) {
  if (info == nullptr || info->struct_size < sizeof(lightloom_vulkan_check_info) ||
      info->get_instance_proc_addr == nullptr || info->instance == VK_NULL_HANDLE ||
      info->physical_device == VK_NULL_HANDLE) {
    return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  }
  return guarded({info->message, info->message_user}, [&]() -> absl::Status {
    if (requirements != nullptr) {
      const auto& need = lightloom::requirements();
      LL_RETURN_IF_ERROR(lightloom::fill(
          lightloom_vulkan_requirements{sizeof(lightloom_vulkan_requirements), need.api_version, need.storage_buffers,
                                        need.invocations, need.shared_bytes, need.push_bytes, need.storage_range,
                                        VK_BUFFER_USAGE_STORAGE_BUFFER_BIT},
          requirements));
    }
    lightloom::VulkanTable vk;
    LL_RETURN_IF_ERROR(vk.load_instance(info->instance, info->get_instance_proc_addr));
    return lightloom::check_device(vk, info->physical_device, info->queue_family, nullptr);
  });
}

lightloom_result lightloom_vulkan_create(const lightloom_vulkan_create_info* info, lightloom_runtime** out) {
  if (out == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  *out = nullptr;
  if (info == nullptr || info->struct_size < sizeof(lightloom_vulkan_create_info)) {
    return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  }
  return lightloom::make_runtime(
      info->allocator, {info->message, info->message_user}, out, [&](lightloom_runtime* runtime) -> absl::Status {
        LL_RETURN_IF_ERROR(lightloom::check_create_info(*info));
        LL_ASSIGN_OR_RETURN(runtime->backend, lightloom::VulkanBackend::create(*info, &runtime->memory));
        return absl::OkStatus();
      });
}

lightloom_result lightloom_create(const lightloom_create_info* info, lightloom_runtime** out) {
  if (out == nullptr) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  *out = nullptr;
  if (info == nullptr || info->struct_size < sizeof(lightloom_create_info)) return LIGHTLOOM_ERROR_INVALID_ARGUMENT;
  if ((info->flags & LIGHTLOOM_CREATE_CPU) != 0) return lightloom::create_on_cpu(*info, out);
  constexpr uint32_t kDeviceFlags = LIGHTLOOM_CREATE_VALIDATION | LIGHTLOOM_CREATE_GPU_ASSISTED;
  lightloom_vulkan_device_info device_info{};
  device_info.struct_size = sizeof device_info;
  device_info.flags = info->flags & kDeviceFlags;
  device_info.message = info->message;
  device_info.message_user = info->message_user;
  lightloom_vulkan_device device;
  const lightloom_result made = lightloom_vulkan_make_device(&device_info, &device);
  if (made != LIGHTLOOM_OK) return made;

  lightloom_vulkan_create_info create{};
  create.struct_size = sizeof create;
  create.flags = info->flags & ~kDeviceFlags;
  create.instance = device.instance;
  create.physical_device = device.physical_device;
  create.device = device.device;
  create.get_instance_proc_addr = device.get_instance_proc_addr;
  create.queue_family = device.queue_family;
  create.frames_in_flight = 4;
  create.byte_budget = info->byte_budget;
  create.page_bytes = info->page_bytes;
  create.staging_bytes = info->staging_bytes;
  create.workgroup_size = info->workgroup_size;
  create.max_workgroups = info->max_workgroups;
  bool owned = false;
  const lightloom_result result = lightloom::make_runtime(
      info->allocator, {info->message, info->message_user}, out, [&](lightloom_runtime* runtime) -> absl::Status {
        LL_RETURN_IF_ERROR(lightloom::check_create_info(create));
        LL_ASSIGN_OR_RETURN(auto backend, lightloom::VulkanBackend::create(create, &runtime->memory));
        owned = true;
        const absl::Status status = backend->own(device);
        runtime->backend = std::move(backend);
        return status;
      });
  if (!owned) lightloom_vulkan_destroy_device(&device);
  return result;
}

lightloom_result lightloom_vulkan_record(lightloom_runtime* runtime, VkCommandBuffer commands,
                                         const lightloom_frame_info* info) {
  return lightloom::with_vulkan_asset(runtime, [&](lightloom::VulkanBackend& backend) -> absl::Status {
    static constexpr lightloom_frame_info kDefault{};
    if (commands == VK_NULL_HANDLE ||
        (info != nullptr && (info->struct_size < sizeof(lightloom_frame_info) ||
                             info->direct_source > LIGHTLOOM_DIRECT_LIGHTS || info->reserved != 0))) {
      return absl::InvalidArgumentError(
          "the command buffer is null, or lightloom_frame_info has a wrong struct_size, direct_source or reserved");
    }
    return backend.record(commands, info == nullptr ? kDefault : *info);
  });
}

lightloom_result lightloom_vulkan_get_outputs(lightloom_runtime* runtime, lightloom_vulkan_outputs* outputs) {
  return lightloom::with_vulkan_asset(runtime, [&](lightloom::VulkanBackend& backend) {
    lightloom_vulkan_outputs filled{};
    backend.fill_outputs(&filled);
    return lightloom::fill(filled, outputs);
  });
}

}  // extern "C"
