#include "tests/bench/repeated_dispatch.h"

#include <cstddef>
#include <cstring>

#include "core/base/check.h"
#include "runtime/shaders/layout.h"
#include "runtime/vulkan/barriers.h"

namespace lightloom::bench {
namespace {

struct Repeats {
  Context context;
  RepeatedPass pass = RepeatedPass::kNone;
  uint32_t more = 0;
};
Repeats repeats;

/// By where the size of the dispatch lies.
RepeatedPass pass_of(VkDeviceSize offset) {
  const auto within = [offset](size_t first) {
    return offset >= first && offset < first + gpu::kMaxPools * sizeof(gpu::Groups);
  };
  if (within(offsetof(gpu::Control, relight))) return RepeatedPass::kRelight;
  if (within(offsetof(gpu::Control, project))) return RepeatedPass::kProject;
  if (within(offsetof(gpu::Control, receive))) return RepeatedPass::kReceive;
  return RepeatedPass::kNone;
}

VKAPI_ATTR void VKAPI_CALL dispatch_indirect(VkCommandBuffer commands, VkBuffer buffer, VkDeviceSize offset) {
  repeats.context.vk.CmdDispatchIndirect(commands, buffer, offset);
  if (repeats.pass == RepeatedPass::kNone || pass_of(offset) != repeats.pass) return;
  for (uint32_t i = 0; i < repeats.more; ++i) {
    barrier_between(repeats.context, commands);
    repeats.context.vk.CmdDispatchIndirect(commands, buffer, offset);
  }
}

VKAPI_ATTR PFN_vkVoidFunction VKAPI_CALL device_proc(VkDevice device, const char* name) {
  if (std::strcmp(name, "vkCmdDispatchIndirect") == 0) return reinterpret_cast<PFN_vkVoidFunction>(&dispatch_indirect);
  return repeats.context.vk.GetDeviceProcAddr(device, name);
}

}  // namespace

void repeat_pass(RepeatedPass pass, uint32_t more) {
  repeats.pass = pass;
  repeats.more = more;
}

void repeat_dispatches(const lightloom_vulkan_device& device, lightloom_vulkan_create_info* info) {
  repeats = {};
  LL_CHECK(repeats.context.vk.load_instance(device.instance, device.get_instance_proc_addr).ok());
  LL_CHECK(repeats.context.vk.load_device(device.device, nullptr).ok());
  info->get_device_proc_addr = device_proc;
}

}  // namespace lightloom::bench
