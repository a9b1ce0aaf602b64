#include "runtime/vulkan/pipelines.h"

#include <algorithm>

namespace lightloom {
namespace {

// Initialiser lists that glslc wrote from shaders/*.comp.
#define LL_SPIRV(name) constexpr uint32_t name[] =
LL_SPIRV(kDirectSpirv)
#include "runtime/shaders/direct.inc"
    ;
LL_SPIRV(kDirectShadowedSpirv)
#include "runtime/shaders/direct_shadowed.inc"
    ;
LL_SPIRV(kRadiositySpirv)
#include "runtime/shaders/radiosity.inc"
    ;
LL_SPIRV(kMarkSpirv)
#include "runtime/shaders/mark.inc"
    ;
LL_SPIRV(kSelectProbesSpirv)
#include "runtime/shaders/select_probes.inc"
    ;
LL_SPIRV(kRelightSpirv)
#include "runtime/shaders/relight.inc"
    ;
LL_SPIRV(kMarkCellsSpirv)
#include "runtime/shaders/mark_cells.inc"
    ;
LL_SPIRV(kSelectCellsSpirv)
#include "runtime/shaders/select_cells.inc"
    ;
LL_SPIRV(kProjectSpirv)
#include "runtime/shaders/project.inc"
    ;
LL_SPIRV(kReceiveSpirv)
#include "runtime/shaders/receive.inc"
    ;
LL_SPIRV(kSettleSpirv)
#include "runtime/shaders/settle.inc"
    ;
LL_SPIRV(kImage16Spirv)
#include "runtime/shaders/image16.inc"
    ;
LL_SPIRV(kImage32Spirv)
#include "runtime/shaders/image32.inc"
    ;

struct PassInfo {
  std::span<const uint32_t> spirv;
  PassBindings bindings;
  uint32_t push_bytes;
};

constexpr std::array<PassInfo, kPasses> kPassInfo = {
    PassInfo{kDirectSpirv, {5, false, false}, sizeof(gpu::DirectPush)},
    PassInfo{kDirectShadowedSpirv, {5, false, true}, sizeof(gpu::DirectPush)},
    PassInfo{kRadiositySpirv, {7, false, false}, sizeof(gpu::RadiosityPush)},
    PassInfo{kMarkSpirv, {4, false, false}, sizeof(gpu::MarkPush)},
    PassInfo{kSelectProbesSpirv, {6, false, false}, sizeof(gpu::SelectProbesPush)},
    PassInfo{kRelightSpirv, {7, false, false}, sizeof(gpu::RelightPush)},
    PassInfo{kMarkCellsSpirv, {6, false, false}, sizeof(gpu::MarkCellsPush)},
    PassInfo{kSelectCellsSpirv, {7, false, false}, sizeof(gpu::SelectCellsPush)},
    PassInfo{kProjectSpirv, {7, false, false}, sizeof(gpu::ProjectPush)},
    PassInfo{kReceiveSpirv, {7, false, false}, sizeof(gpu::ReceivePush)},
    PassInfo{kSettleSpirv, {1, false, false}, sizeof(gpu::SettlePush)},
    PassInfo{kImage16Spirv, {2, true, false}, sizeof(gpu::ImagePush)},
    PassInfo{kImage32Spirv, {2, true, false}, sizeof(gpu::ImagePush)},
};
const PassInfo& info_of(Pass pass) { return kPassInfo[static_cast<size_t>(pass)]; }

}  // namespace

PassBindings bindings_of(Pass pass) { return info_of(pass).bindings; }

absl::StatusOr<std::unique_ptr<Pipelines>> Pipelines::create(Context* context) {
  std::unique_ptr<Pipelines> pipelines(new Pipelines(context));
  LL_RETURN_IF_ERROR(pipelines->create_sampler());
  for (size_t p = 0; p < kPasses; ++p) LL_RETURN_IF_ERROR(pipelines->create_entry(static_cast<Pass>(p)));
  return pipelines;
}

Pipelines::~Pipelines() {
  const VulkanTable& vk = context_->vk;
  for (const Entry& e : entries_) {
    vk.DestroyPipeline(context_->device, e.pipeline, context_->callbacks);
    vk.DestroyPipelineLayout(context_->device, e.layout, context_->callbacks);
    vk.DestroyDescriptorSetLayout(context_->device, e.set_layout, context_->callbacks);
  }
  vk.DestroySampler(context_->device, sampler_, context_->callbacks);
}

absl::Status Pipelines::create_sampler() {
  auto info = vulkan_struct<VkSamplerCreateInfo>(VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO);
  info.magFilter = info.minFilter = context_->linear_depth ? VK_FILTER_LINEAR : VK_FILTER_NEAREST;
  info.addressModeU = info.addressModeV = info.addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  info.compareEnable = VK_TRUE;
  info.compareOp = VK_COMPARE_OP_LESS_OR_EQUAL;
  return vulkan_status(context_->vk.CreateSampler(context_->device, &info, context_->callbacks, &sampler_),
                       "vkCreateSampler");
}

absl::Status Pipelines::create_entry(Pass pass) {
  const VulkanTable& vk = context_->vk;
  const PassInfo& pass_info = info_of(pass);
  Entry& entry = entries_[static_cast<size_t>(pass)];

  std::array<VkDescriptorSetLayoutBinding, kMaxBindings + 1> bindings{};
  uint32_t count = 0;
  const auto add = [&](VkDescriptorType type) {
    bindings[count] = {count, type, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr};
    ++count;
  };
  for (uint32_t b = 0; b < pass_info.bindings.buffers; ++b) add(VK_DESCRIPTOR_TYPE_STORAGE_BUFFER);
  if (pass_info.bindings.storage_image) add(VK_DESCRIPTOR_TYPE_STORAGE_IMAGE);
  if (pass_info.bindings.sampler) add(VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER);
  auto set = vulkan_struct<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  set.bindingCount = count;
  set.pBindings = bindings.data();
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorSetLayout",
                        vk.CreateDescriptorSetLayout(context_->device, &set, context_->callbacks, &entry.set_layout));

  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, pass_info.push_bytes};
  auto layout = vulkan_struct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.setLayoutCount = 1;
  layout.pSetLayouts = &entry.set_layout;
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &push;
  LL_VK_RETURN_IF_ERROR("vkCreatePipelineLayout",
                        vk.CreatePipelineLayout(context_->device, &layout, context_->callbacks, &entry.layout));

  auto module = vulkan_struct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  module.codeSize = pass_info.spirv.size_bytes();
  module.pCode = pass_info.spirv.data();
  VkShaderModule shader = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateShaderModule",
                        vk.CreateShaderModule(context_->device, &module, context_->callbacks, &shader));
  const VkSpecializationMapEntry group{0, 0, sizeof(uint32_t)};
  const VkSpecializationInfo specialization{1, &group, sizeof(uint32_t), &context_->group};
  auto pipeline = vulkan_struct<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  pipeline.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  pipeline.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  pipeline.stage.module = shader;
  pipeline.stage.pName = "main";
  pipeline.stage.pSpecializationInfo = &specialization;
  pipeline.layout = entry.layout;
  const VkResult result =
      vk.CreateComputePipelines(context_->device, VK_NULL_HANDLE, 1, &pipeline, context_->callbacks, &entry.pipeline);
  vk.DestroyShaderModule(context_->device, shader, context_->callbacks);
  return vulkan_status(result, "vkCreateComputePipelines");
}

void Pipelines::bind(VkCommandBuffer commands, Pass pass, VkDescriptorSet set, const void* push,
                     uint32_t push_bytes) const {
  const Entry& entry = entries_[static_cast<size_t>(pass)];
  context_->vk.CmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, entry.pipeline);
  context_->vk.CmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, entry.layout, 0, 1, &set, 0, nullptr);
  context_->vk.CmdPushConstants(commands, entry.layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, push_bytes, push);
}

void Pipelines::dispatch(VkCommandBuffer commands, uint64_t groups) const {
  if (groups == 0) return;
  const uint64_t x = std::min<uint64_t>(groups, context_->max_groups);
  context_->vk.CmdDispatch(commands, static_cast<uint32_t>(x), static_cast<uint32_t>((groups + x - 1) / x), 1);
}

}  // namespace lightloom
