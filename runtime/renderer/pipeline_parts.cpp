#include "runtime/renderer/pipeline_parts.h"

#include <array>

#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

absl::StatusOr<Owned<VkShaderModule>> shader(VkDevice device, std::span<const uint32_t> code) {
  auto info = vulkan_struct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  info.codeSize = code.size_bytes();
  info.pCode = code.data();
  VkShaderModule handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateShaderModule", vkCreateShaderModule(device, &info, nullptr, &handle));
  return Owned<VkShaderModule>(device, handle, vkDestroyShaderModule);
}

}  // namespace

absl::StatusOr<Owned<VkDescriptorSetLayout>> set_layout(VkDevice device, const std::vector<VkDescriptorType>& types) {
  std::vector<VkDescriptorSetLayoutBinding> bindings(types.size());
  for (uint32_t b = 0; b < bindings.size(); ++b) {
    bindings[b] = {b, types[b], 1, VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, nullptr};
  }
  auto info = vulkan_struct<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  info.bindingCount = static_cast<uint32_t>(bindings.size());
  info.pBindings = bindings.data();
  VkDescriptorSetLayout handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorSetLayout", vkCreateDescriptorSetLayout(device, &info, nullptr, &handle));
  return Owned<VkDescriptorSetLayout>(device, handle, vkDestroyDescriptorSetLayout);
}

absl::StatusOr<Owned<VkPipelineLayout>> pipeline_layout(VkDevice device, std::vector<VkDescriptorSetLayout> sets,
                                                        uint32_t push_bytes) {
  const VkPushConstantRange push{VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, push_bytes};
  auto info = vulkan_struct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  info.setLayoutCount = static_cast<uint32_t>(sets.size());
  info.pSetLayouts = sets.data();
  info.pushConstantRangeCount = 1;
  info.pPushConstantRanges = &push;
  VkPipelineLayout handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreatePipelineLayout", vkCreatePipelineLayout(device, &info, nullptr, &handle));
  return Owned<VkPipelineLayout>(device, handle, vkDestroyPipelineLayout);
}

absl::StatusOr<Owned<VkPipeline>> graphics_pipeline(VkDevice device, const GraphicsPipeline& want) {
  const uint32_t colours = want.colour != VK_FORMAT_UNDEFINED ? 1 : 0;
  LL_ASSIGN_OR_RETURN(const auto vertex, shader(device, want.vertex));
  Owned<VkShaderModule> fragment;
  if (!want.fragment.empty()) {
    LL_ASSIGN_OR_RETURN(fragment, shader(device, want.fragment));
  }
  std::array<VkPipelineShaderStageCreateInfo, 2> stages{};
  for (VkPipelineShaderStageCreateInfo& stage : stages) {
    stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
    stage.pName = "main";
  }
  stages[0].stage = VK_SHADER_STAGE_VERTEX_BIT;
  stages[0].module = vertex.get();
  stages[1].stage = VK_SHADER_STAGE_FRAGMENT_BIT;
  stages[1].module = fragment.get();

  const VkVertexInputBindingDescription binding{0, want.stride, VK_VERTEX_INPUT_RATE_VERTEX};
  auto input =
      vulkan_struct<VkPipelineVertexInputStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VERTEX_INPUT_STATE_CREATE_INFO);
  input.vertexBindingDescriptionCount = want.stride > 0 ? 1u : 0u;
  input.pVertexBindingDescriptions = &binding;
  input.vertexAttributeDescriptionCount = static_cast<uint32_t>(want.attributes.size());
  input.pVertexAttributeDescriptions = want.attributes.data();

  auto assembly = vulkan_struct<VkPipelineInputAssemblyStateCreateInfo>(
      VK_STRUCTURE_TYPE_PIPELINE_INPUT_ASSEMBLY_STATE_CREATE_INFO);
  assembly.topology = want.topology;
  auto viewport =
      vulkan_struct<VkPipelineViewportStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_VIEWPORT_STATE_CREATE_INFO);
  viewport.viewportCount = 1;
  viewport.scissorCount = 1;
  auto raster =
      vulkan_struct<VkPipelineRasterizationStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_RASTERIZATION_STATE_CREATE_INFO);
  raster.cullMode = VK_CULL_MODE_NONE;
  raster.lineWidth = 1;
  auto samples =
      vulkan_struct<VkPipelineMultisampleStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_MULTISAMPLE_STATE_CREATE_INFO);
  samples.rasterizationSamples = VK_SAMPLE_COUNT_1_BIT;
  auto depth =
      vulkan_struct<VkPipelineDepthStencilStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_DEPTH_STENCIL_STATE_CREATE_INFO);
  depth.depthTestEnable = want.depth != VK_FORMAT_UNDEFINED;
  depth.depthWriteEnable = want.depth_write;
  depth.depthCompareOp = want.depth_test;
  VkPipelineColorBlendAttachmentState write{};
  write.blendEnable = want.blend;
  write.srcColorBlendFactor = VK_BLEND_FACTOR_SRC_ALPHA;
  write.dstColorBlendFactor = VK_BLEND_FACTOR_ONE_MINUS_SRC_ALPHA;
  write.dstAlphaBlendFactor = VK_BLEND_FACTOR_ONE;
  write.colorWriteMask =
      VK_COLOR_COMPONENT_R_BIT | VK_COLOR_COMPONENT_G_BIT | VK_COLOR_COMPONENT_B_BIT | VK_COLOR_COMPONENT_A_BIT;
  auto blend =
      vulkan_struct<VkPipelineColorBlendStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_COLOR_BLEND_STATE_CREATE_INFO);
  blend.attachmentCount = colours;
  blend.pAttachments = &write;
  const std::array<VkDynamicState, 2> dynamic_states{VK_DYNAMIC_STATE_VIEWPORT, VK_DYNAMIC_STATE_SCISSOR};
  auto dynamic = vulkan_struct<VkPipelineDynamicStateCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_DYNAMIC_STATE_CREATE_INFO);
  dynamic.dynamicStateCount = static_cast<uint32_t>(dynamic_states.size());
  dynamic.pDynamicStates = dynamic_states.data();
  auto rendering = vulkan_struct<VkPipelineRenderingCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_RENDERING_CREATE_INFO);
  rendering.colorAttachmentCount = colours;
  rendering.pColorAttachmentFormats = &want.colour;
  rendering.depthAttachmentFormat = want.depth;

  auto info = vulkan_struct<VkGraphicsPipelineCreateInfo>(VK_STRUCTURE_TYPE_GRAPHICS_PIPELINE_CREATE_INFO);
  info.pNext = &rendering;
  info.stageCount = want.fragment.empty() ? 1u : 2u;
  info.pStages = stages.data();
  info.pVertexInputState = &input;
  info.pInputAssemblyState = &assembly;
  info.pViewportState = &viewport;
  info.pRasterizationState = &raster;
  info.pMultisampleState = &samples;
  info.pDepthStencilState = &depth;
  info.pColorBlendState = &blend;
  info.pDynamicState = &dynamic;
  info.layout = want.layout;
  VkPipeline handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateGraphicsPipelines",
                        vkCreateGraphicsPipelines(device, VK_NULL_HANDLE, 1, &info, nullptr, &handle));
  return Owned<VkPipeline>(device, handle, vkDestroyPipeline);
}

}  // namespace lightloom::renderer
