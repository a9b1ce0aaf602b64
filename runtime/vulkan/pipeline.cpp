#include "runtime/vulkan/pipeline.h"

#include <algorithm>
#include <vector>

#include "core/base/check.h"
#include "runtime/shaders/layout.h"
#include "runtime/vulkan/status.h"

namespace lightloom {
namespace {

// Initialiser lists that glslc wrote from shaders/*.comp.
constexpr uint32_t kRadiositySpirv[] =
#include "runtime/shaders/radiosity.comp.inc"
    ;
constexpr uint32_t kRelightSpirv[] =
#include "runtime/shaders/relight.comp.inc"
    ;
constexpr uint32_t kProjectSpirv[] =
#include "runtime/shaders/project.comp.inc"
    ;
constexpr uint32_t kReceiveSpirv[] =
#include "runtime/shaders/receive.comp.inc"
    ;

struct PassInfo {
  std::span<const uint32_t> spirv;
  uint32_t bindings;
  uint32_t push_bytes;
};

constexpr std::array<PassInfo, kPasses> kPassInfo = {
    PassInfo{kRadiositySpirv, 5, sizeof(gpu::RadiosityPush)},
    PassInfo{kRelightSpirv, 4, sizeof(gpu::RelightPush)},
    PassInfo{kProjectSpirv, 7, sizeof(gpu::ProjectPush)},
    PassInfo{kReceiveSpirv, 7, sizeof(gpu::ReceivePush)},
};
const PassInfo& info_of(Pass pass) { return kPassInfo[static_cast<size_t>(pass)]; }

}  // namespace

uint32_t pass_bindings(Pass pass) { return info_of(pass).bindings; }

absl::StatusOr<std::unique_ptr<Pipelines>> Pipelines::create(Device* device) {
  std::unique_ptr<Pipelines> pipelines(new Pipelines(device));
  for (size_t p = 0; p < kPasses; ++p) LL_RETURN_IF_ERROR(pipelines->create_entry(static_cast<Pass>(p)));
  return pipelines;
}

Pipelines::~Pipelines() {
  for (const Entry& e : entries_) {
    vkDestroyPipeline(device_->handle(), e.pipeline, nullptr);
    vkDestroyPipelineLayout(device_->handle(), e.layout, nullptr);
    vkDestroyDescriptorSetLayout(device_->handle(), e.set_layout, nullptr);
  }
}

absl::Status Pipelines::create_entry(Pass pass) {
  const PassInfo& pass_info = info_of(pass);
  Entry& entry = entries_[static_cast<size_t>(pass)];

  std::vector<VkDescriptorSetLayoutBinding> bindings;
  for (uint32_t b = 0; b < pass_info.bindings; ++b) {
    bindings.push_back({b, VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 1, VK_SHADER_STAGE_COMPUTE_BIT, nullptr});
  }
  auto set = vulkan_struct<VkDescriptorSetLayoutCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_LAYOUT_CREATE_INFO);
  set.bindingCount = pass_info.bindings;
  set.pBindings = bindings.data();
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorSetLayout",
                        vkCreateDescriptorSetLayout(device_->handle(), &set, nullptr, &entry.set_layout));

  const VkPushConstantRange push{VK_SHADER_STAGE_COMPUTE_BIT, 0, pass_info.push_bytes};
  auto layout = vulkan_struct<VkPipelineLayoutCreateInfo>(VK_STRUCTURE_TYPE_PIPELINE_LAYOUT_CREATE_INFO);
  layout.setLayoutCount = 1;
  layout.pSetLayouts = &entry.set_layout;
  layout.pushConstantRangeCount = 1;
  layout.pPushConstantRanges = &push;
  LL_VK_RETURN_IF_ERROR("vkCreatePipelineLayout",
                        vkCreatePipelineLayout(device_->handle(), &layout, nullptr, &entry.layout));

  auto module = vulkan_struct<VkShaderModuleCreateInfo>(VK_STRUCTURE_TYPE_SHADER_MODULE_CREATE_INFO);
  module.codeSize = pass_info.spirv.size_bytes();
  module.pCode = pass_info.spirv.data();
  VkShaderModule shader = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateShaderModule", vkCreateShaderModule(device_->handle(), &module, nullptr, &shader));
  auto pipeline = vulkan_struct<VkComputePipelineCreateInfo>(VK_STRUCTURE_TYPE_COMPUTE_PIPELINE_CREATE_INFO);
  pipeline.stage.sType = VK_STRUCTURE_TYPE_PIPELINE_SHADER_STAGE_CREATE_INFO;
  pipeline.stage.stage = VK_SHADER_STAGE_COMPUTE_BIT;
  pipeline.stage.module = shader;
  pipeline.stage.pName = "main";
  pipeline.layout = entry.layout;
  const VkResult result =
      vkCreateComputePipelines(device_->handle(), VK_NULL_HANDLE, 1, &pipeline, nullptr, &entry.pipeline);
  vkDestroyShaderModule(device_->handle(), shader, nullptr);
  return vulkan_status(result, "vkCreateComputePipelines");
}

void Pipelines::dispatch(VkCommandBuffer commands, Pass pass, VkDescriptorSet set, const void* push,
                         uint32_t push_bytes, uint64_t groups, uint32_t max_groups) const {
  LL_CHECK(push_bytes == info_of(pass).push_bytes);
  if (groups == 0) return;
  const Entry& entry = entries_[static_cast<size_t>(pass)];
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_COMPUTE, entry.pipeline);
  vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_COMPUTE, entry.layout, 0, 1, &set, 0, nullptr);
  vkCmdPushConstants(commands, entry.layout, VK_SHADER_STAGE_COMPUTE_BIT, 0, push_bytes, push);
  const uint32_t x = static_cast<uint32_t>(std::min<uint64_t>(groups, max_groups));
  const uint32_t y = static_cast<uint32_t>((groups + x - 1) / x);
  vkCmdDispatch(commands, x, y, 1);
}

absl::StatusOr<std::unique_ptr<DescriptorSets>> DescriptorSets::create(Device* device, std::span<const Pass> passes) {
  std::unique_ptr<DescriptorSets> sets(new DescriptorSets(device));
  VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 0};
  for (const Pass p : passes) size.descriptorCount += pass_bindings(p);
  auto info = vulkan_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  info.maxSets = static_cast<uint32_t>(passes.size());
  info.poolSizeCount = 1;
  info.pPoolSizes = &size;
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorPool",
                        vkCreateDescriptorPool(device->handle(), &info, nullptr, &sets->pool_));
  return sets;
}

DescriptorSets::~DescriptorSets() { vkDestroyDescriptorPool(device_->handle(), pool_, nullptr); }

absl::StatusOr<VkDescriptorSet> DescriptorSets::set(const Pipelines& pipelines, Pass pass,
                                                    std::span<const VkDescriptorBufferInfo> ranges) {
  LL_CHECK(ranges.size() == pass_bindings(pass));
  const VkDescriptorSetLayout layout = pipelines.set_layout(pass);
  auto info = vulkan_struct<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  info.descriptorPool = pool_;
  info.descriptorSetCount = 1;
  info.pSetLayouts = &layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkAllocateDescriptorSets", vkAllocateDescriptorSets(device_->handle(), &info, &set));
  auto write = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  write.dstSet = set;
  write.descriptorCount = 1;
  write.descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  for (const VkDescriptorBufferInfo& range : ranges) {
    write.pBufferInfo = &range;
    vkUpdateDescriptorSets(device_->handle(), 1, &write, 0, nullptr);
    ++write.dstBinding;
  }
  return set;
}

}  // namespace lightloom
