// What graphics pipelines are made of: descriptor layouts, pipeline layouts, and a pipeline from what it differs in.
#pragma once

#include <span>
#include <vector>

#include "runtime/renderer/gpu.h"

namespace lightloom::renderer {

/// One descriptor of each type, bindings 0, 1, …, for vertex and fragment shaders.
absl::StatusOr<Owned<VkDescriptorSetLayout>> set_layout(VkDevice device, const std::vector<VkDescriptorType>& types);
/// With `push_bytes` of push constants for both stages.
absl::StatusOr<Owned<VkPipelineLayout>> pipeline_layout(VkDevice device, std::vector<VkDescriptorSetLayout> sets,
                                                        uint32_t push_bytes);

struct GraphicsPipeline {
  VkPipelineLayout layout = VK_NULL_HANDLE;
  std::span<const uint32_t> vertex, fragment;  ///< fragment may be empty
  uint32_t stride = 0;                         ///< of a vertex, bytes; 0: no vertex buffer
  std::vector<VkVertexInputAttributeDescription> attributes = {};
  VkPrimitiveTopology topology = VK_PRIMITIVE_TOPOLOGY_TRIANGLE_LIST;
  VkFormat colour = VK_FORMAT_UNDEFINED;  ///< undefined: no colour attachment
  VkFormat depth = VK_FORMAT_UNDEFINED;   ///< undefined: no depth test
  VkCompareOp depth_test = VK_COMPARE_OP_ALWAYS;
  bool depth_write = true;
  bool blend = false;  ///< over what is there, by alpha
};

/// For dynamic rendering; viewport and scissor are dynamic. Draws both sides of triangles.
absl::StatusOr<Owned<VkPipeline>> graphics_pipeline(VkDevice device, const GraphicsPipeline& want);

}  // namespace lightloom::renderer
