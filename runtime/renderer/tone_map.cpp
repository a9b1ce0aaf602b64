#include "runtime/renderer/tone_map.h"

#include "runtime/renderer/pipeline_parts.h"
#include "runtime/renderer/shaders/frame.h"
#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

// clang-format off
constexpr uint32_t kVert[] =
#include "runtime/renderer/shaders/tone_map.vert.inc"
;
constexpr uint32_t kFrag[] =
#include "runtime/renderer/shaders/tone_map.frag.inc"
;
// clang-format on

}  // namespace

absl::StatusOr<ToneMap> ToneMap::create(const Gpu& gpu, VkFormat format) {
  ToneMap t;
  t.device_ = gpu.device();
  constexpr VkDescriptorType kImage = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
  LL_ASSIGN_OR_RETURN(t.set_layout_, set_layout(t.device_, {kImage}));
  LL_ASSIGN_OR_RETURN(t.layout_, pipeline_layout(t.device_, {t.set_layout_.get()}, sizeof(gpu::ToneMapPush)));
  GraphicsPipeline info;
  info.layout = t.layout_.get();
  info.vertex = kVert;
  info.fragment = kFrag;
  info.colour = format;
  LL_ASSIGN_OR_RETURN(t.pipeline_, graphics_pipeline(t.device_, info));

  const auto sampler = vulkan_struct<VkSamplerCreateInfo>(VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO);
  VkSampler nearest = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateSampler", vkCreateSampler(t.device_, &sampler, nullptr, &nearest));
  t.sampler_ = {t.device_, nearest, vkDestroySampler};
  const VkDescriptorPoolSize size{kImage, 1};
  auto pool_info = vulkan_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  pool_info.maxSets = 1;
  pool_info.poolSizeCount = 1;
  pool_info.pPoolSizes = &size;
  VkDescriptorPool pool = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorPool", vkCreateDescriptorPool(t.device_, &pool_info, nullptr, &pool));
  t.pool_ = {t.device_, pool, vkDestroyDescriptorPool};
  const VkDescriptorSetLayout layout = t.set_layout_.get();
  auto allocate = vulkan_struct<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
  allocate.descriptorPool = pool;
  allocate.descriptorSetCount = 1;
  allocate.pSetLayouts = &layout;
  LL_VK_RETURN_IF_ERROR("vkAllocateDescriptorSets", vkAllocateDescriptorSets(t.device_, &allocate, &t.set_));
  return t;
}

void ToneMap::set_source(const Texture2D& radiance) const {
  const VkDescriptorImageInfo image{sampler_.get(), radiance.view.get(), kSampled.layout};
  auto write = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
  write.dstSet = set_;
  write.descriptorCount = 1;
  write.descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
  write.pImageInfo = &image;
  vkUpdateDescriptorSets(device_, 1, &write, 0, nullptr);
}

void ToneMap::record(VkCommandBuffer commands, const Texture2D& target, float exposure) const {
  transition(commands, target.handle.get(), VK_IMAGE_ASPECT_COLOR_BIT, kNoUse, kColour);
  auto colour = vulkan_struct<VkRenderingAttachmentInfo>(VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO);
  colour.imageView = target.view.get();
  colour.imageLayout = kColour.layout;
  colour.loadOp = VK_ATTACHMENT_LOAD_OP_DONT_CARE;
  colour.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
  auto rendering = vulkan_struct<VkRenderingInfo>(VK_STRUCTURE_TYPE_RENDERING_INFO);
  rendering.renderArea = {{0, 0}, {target.width, target.height}};
  rendering.layerCount = 1;
  rendering.colorAttachmentCount = 1;
  rendering.pColorAttachments = &colour;
  const VkViewport viewport{0, 0, static_cast<float>(target.width), static_cast<float>(target.height), 0, 1};
  const gpu::ToneMapPush push{exposure};
  vkCmdBeginRendering(commands, &rendering);
  vkCmdSetViewport(commands, 0, 1, &viewport);
  vkCmdSetScissor(commands, 0, 1, &rendering.renderArea);
  vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipeline_.get());
  vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout_.get(), 0, 1, &set_, 0, nullptr);
  vkCmdPushConstants(commands, layout_.get(), VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT, 0, sizeof push,
                     &push);
  vkCmdDraw(commands, 3, 1, 0, 0);
  vkCmdEndRendering(commands);
}

}  // namespace lightloom::renderer
