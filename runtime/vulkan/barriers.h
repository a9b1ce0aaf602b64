// Memory barriers: few and broad, since every pass reads what the one before wrote.
#pragma once

#include "runtime/vulkan/context.h"

namespace lightloom {

inline void memory_barrier(const Context& context, VkCommandBuffer commands, VkPipelineStageFlags from_stage,
                           VkAccessFlags from, VkPipelineStageFlags to_stage, VkAccessFlags to) {
  auto barrier = vulkan_struct<VkMemoryBarrier>(VK_STRUCTURE_TYPE_MEMORY_BARRIER);
  barrier.srcAccessMask = from;
  barrier.dstAccessMask = to;
  context.vk.CmdPipelineBarrier(commands, from_stage, to_stage, 0, 1, &barrier, 0, nullptr, 0, nullptr);
}

inline constexpr VkPipelineStageFlags kOurStages =
    VK_PIPELINE_STAGE_COMPUTE_SHADER_BIT | VK_PIPELINE_STAGE_TRANSFER_BIT | VK_PIPELINE_STAGE_DRAW_INDIRECT_BIT;
inline constexpr VkAccessFlags kOurWrites = VK_ACCESS_SHADER_WRITE_BIT | VK_ACCESS_TRANSFER_WRITE_BIT;
inline constexpr VkAccessFlags kOurReads =
    VK_ACCESS_SHADER_READ_BIT | VK_ACCESS_TRANSFER_READ_BIT | VK_ACCESS_INDIRECT_COMMAND_READ_BIT;

/// What shaders and copies wrote becomes visible to our next ones, which also wait for what they overwrite.
inline void barrier_between(const Context& context, VkCommandBuffer commands) {
  memory_barrier(context, commands, kOurStages, kOurWrites, kOurStages, kOurReads | kOurWrites);
}
/// Our commands wait for all before them.
inline void barrier_before(const Context& context, VkCommandBuffer commands) {
  memory_barrier(context, commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_ACCESS_MEMORY_WRITE_BIT, kOurStages,
                 kOurReads | kOurWrites);
}
/// All commands after ours see what ours wrote; the host does once it has waited.
inline void barrier_after(const Context& context, VkCommandBuffer commands) {
  memory_barrier(context, commands, kOurStages, kOurWrites,
                 VK_PIPELINE_STAGE_ALL_COMMANDS_BIT | VK_PIPELINE_STAGE_HOST_BIT,
                 VK_ACCESS_MEMORY_READ_BIT | VK_ACCESS_HOST_READ_BIT);
}

}  // namespace lightloom
