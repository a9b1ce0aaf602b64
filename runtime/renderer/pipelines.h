// The renderer's three graphics pipelines and the descriptor layouts they share.
#pragma once

#include "runtime/renderer/gpu.h"

namespace lightloom::renderer {

inline constexpr VkFormat kColourFormat = VK_FORMAT_R32G32B32A32_SFLOAT;
inline constexpr VkFormat kDepthFormat = VK_FORMAT_D32_SFLOAT;

struct Pipelines {
  Owned<VkDescriptorSetLayout> frame_set;     ///< 0 FrameData, 1 LightData[], 2 ViewData[], 3 shadow maps, 4 E
  Owned<VkDescriptorSetLayout> material_set;  ///< 0 base colour, 1 emission
  Owned<VkPipelineLayout> forward_layout;     ///< sets: frame, material; MaterialPush
  Owned<VkPipelineLayout> shadow_layout;      ///< set: material; ShadowPush
  Owned<VkPipeline> forward;
  Owned<VkPipeline> shadow;         ///< opaque surfaces: no fragment shader
  Owned<VkPipeline> shadow_masked;  ///< discards in the holes
};

absl::StatusOr<Pipelines> make_pipelines(const Gpu& gpu);

}  // namespace lightloom::renderer
