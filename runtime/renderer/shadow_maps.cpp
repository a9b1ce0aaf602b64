#include "runtime/renderer/shadow_maps.h"

#include <algorithm>
#include <string>

#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

constexpr uint32_t kLargest = 2048, kSmallest = 256;
constexpr uint64_t kBytes = 256ull << 20;  // of all layers, where the caller gives no size

uint32_t fitting_size(uint32_t layers) {
  uint32_t size = kLargest;
  while (size > kSmallest && 4ull * size * size * layers > kBytes) size /= 2;
  return size;
}

}  // namespace

absl::StatusOr<ShadowMaps> ShadowMaps::create(const Gpu& gpu, uint32_t views, uint32_t size) {
  ShadowMaps maps;
  TextureInfo info;
  info.format = kDepthFormat;
  info.layers = std::max(1u, views);
  info.width = info.height = size > 0 ? size : fitting_size(info.layers);
  info.array = true;
  info.aspect = VK_IMAGE_ASPECT_DEPTH_BIT;
  info.usage = VK_IMAGE_USAGE_DEPTH_STENCIL_ATTACHMENT_BIT | VK_IMAGE_USAGE_SAMPLED_BIT;
  LL_ASSIGN_OR_RETURN(maps.image_, gpu.texture(info));
  for (uint32_t layer = 0; layer < info.layers; ++layer) {
    auto view = vulkan_struct<VkImageViewCreateInfo>(VK_STRUCTURE_TYPE_IMAGE_VIEW_CREATE_INFO);
    view.image = maps.image_.handle.get();
    view.viewType = VK_IMAGE_VIEW_TYPE_2D;
    view.format = info.format;
    view.subresourceRange = {info.aspect, 0, 1, layer, 1};
    VkImageView handle = VK_NULL_HANDLE;
    LL_VK_RETURN_IF_ERROR("vkCreateImageView", vkCreateImageView(gpu.device(), &view, nullptr, &handle));
    maps.layers_.emplace_back(gpu.device(), handle, vkDestroyImageView);
  }
  return maps;
}

void ShadowMaps::record(VkCommandBuffer commands, const std::vector<gpu::ViewData>& views, bool keep,
                        const Pipelines& pipelines, VkBuffer vertices, const Mesh& mesh, const Scene& scene,
                        const Materials& materials) const {
  if (keep && views.empty()) return;
  // What sampled the maps before must be done.
  Use before = kSampled;
  if (!keep) before.layout = VK_IMAGE_LAYOUT_UNDEFINED;
  transition(commands, image_.handle.get(), VK_IMAGE_ASPECT_DEPTH_BIT, before, kDepth);
  const VkRect2D area{{0, 0}, {image_.width, image_.height}};
  const VkViewport viewport{0, 0, static_cast<float>(image_.width), static_cast<float>(image_.height), 0, 1};
  vkCmdSetViewport(commands, 0, 1, &viewport);
  vkCmdSetScissor(commands, 0, 1, &area);
  const VkDeviceSize start = 0;
  vkCmdBindVertexBuffers(commands, 0, 1, &vertices, &start);
  constexpr VkShaderStageFlags kStages = VK_SHADER_STAGE_VERTEX_BIT | VK_SHADER_STAGE_FRAGMENT_BIT;
  const VkPipelineLayout layout = pipelines.shadow_layout.get();

  for (const gpu::ViewData& view : views) {
    auto depth = vulkan_struct<VkRenderingAttachmentInfo>(VK_STRUCTURE_TYPE_RENDERING_ATTACHMENT_INFO);
    depth.imageView = layers_[view.layer].get();
    depth.imageLayout = kDepth.layout;
    depth.loadOp = VK_ATTACHMENT_LOAD_OP_CLEAR;
    depth.storeOp = VK_ATTACHMENT_STORE_OP_STORE;
    depth.clearValue.depthStencil = {1, 0};
    auto rendering = vulkan_struct<VkRenderingInfo>(VK_STRUCTURE_TYPE_RENDERING_INFO);
    rendering.renderArea = area;
    rendering.layerCount = 1;
    rendering.pDepthAttachment = &depth;
    vkCmdBeginRendering(commands, &rendering);
    gpu::ShadowPush push{view.view_projection, 1, -1};
    if (mesh.opaque > 0) {
      vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipelines.shadow.get());
      vkCmdPushConstants(commands, layout, kStages, 0, sizeof push, &push);
      vkCmdDraw(commands, mesh.opaque, 1, 0, 0);
    }
    bool bound = false;
    for (const DrawRange& range : mesh.ranges) {
      if (range.first < mesh.opaque) continue;
      if (!bound) vkCmdBindPipeline(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, pipelines.shadow_masked.get());
      bound = true;
      const VkDescriptorSet set = materials.set(range.material);
      vkCmdBindDescriptorSets(commands, VK_PIPELINE_BIND_POINT_GRAPHICS, layout, 0, 1, &set, 0, nullptr);
      push.alpha = scene.materials[range.material].alpha;
      push.cutoff = scene.materials[range.material].alpha_cutoff;
      vkCmdPushConstants(commands, layout, kStages, 0, sizeof push, &push);
      vkCmdDraw(commands, range.count, 1, range.first, 0);
    }
    vkCmdEndRendering(commands);
  }
  transition(commands, image_.handle.get(), VK_IMAGE_ASPECT_DEPTH_BIT, kDepth, kSampled);
}

}  // namespace lightloom::renderer
