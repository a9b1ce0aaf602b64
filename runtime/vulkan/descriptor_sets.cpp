#include "runtime/vulkan/descriptor_sets.h"

#include "core/base/check.h"

namespace lightloom {

absl::StatusOr<std::unique_ptr<DescriptorSets>> DescriptorSets::create(Context* context, const Pipelines* pipelines,
                                                                       std::span<const Demand> demands) {
  std::unique_ptr<DescriptorSets> sets(new DescriptorSets(context, pipelines));
  VkDescriptorPoolSize sizes[] = {{VK_DESCRIPTOR_TYPE_STORAGE_BUFFER, 0},
                                  {VK_DESCRIPTOR_TYPE_STORAGE_IMAGE, 1},
                                  {VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 1}};
  auto info = vulkan_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  for (const Demand& d : demands) {
    const PassBindings bindings = bindings_of(d.pass);
    info.maxSets += d.sets;
    sizes[0].descriptorCount += d.sets * bindings.buffers;
    sizes[1].descriptorCount += bindings.storage_image ? d.sets : 0;
    sizes[2].descriptorCount += bindings.sampler ? d.sets : 0;
  }
  info.poolSizeCount = 3;
  info.pPoolSizes = sizes;
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorPool",
                        context->vk.CreateDescriptorPool(context->device, &info, context->callbacks, &sets->pool_));
  return sets;
}

DescriptorSets::~DescriptorSets() { context_->vk.DestroyDescriptorPool(context_->device, pool_, context_->callbacks); }

absl::StatusOr<VkDescriptorSet> DescriptorSets::allocate(Pass pass) {
  const VkDescriptorSetLayout layout = pipelines_->set_layout(pass);
  auto info = vulkan_struct<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  info.descriptorPool = pool_;
  info.descriptorSetCount = 1;
  info.pSetLayouts = &layout;
  VkDescriptorSet set = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkAllocateDescriptorSets", context_->vk.AllocateDescriptorSets(context_->device, &info, &set));
  return set;
}

void DescriptorSets::write(VkDescriptorSet set, Pass pass, std::span<const VkDescriptorBufferInfo> buffers,
                           const VkDescriptorImageInfo* image) const {
  const PassBindings bindings = bindings_of(pass);
  LL_CHECK(buffers.size() == bindings.buffers);
  VkWriteDescriptorSet writes[2];
  writes[0] = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  writes[0].dstSet = set;
  writes[0].descriptorCount = bindings.buffers;
  writes[0].descriptorType = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  writes[0].pBufferInfo = buffers.data();
  writes[1] = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  writes[1].dstSet = set;
  writes[1].dstBinding = bindings.buffers;
  writes[1].descriptorCount = 1;
  writes[1].descriptorType =
      bindings.sampler ? VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER : VK_DESCRIPTOR_TYPE_STORAGE_IMAGE;
  writes[1].pImageInfo = image;
  context_->vk.UpdateDescriptorSets(context_->device, image == nullptr ? 1 : 2, writes, 0, nullptr);
}

absl::StatusOr<VkDescriptorSet> DescriptorSets::make(Pass pass, std::span<const VkDescriptorBufferInfo> buffers,
                                                     const VkDescriptorImageInfo* image) {
  LL_ASSIGN_OR_RETURN(const VkDescriptorSet set, allocate(pass));
  write(set, pass, buffers, image);
  return set;
}

}  // namespace lightloom
