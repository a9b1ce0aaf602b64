#include "runtime/renderer/pipelines.h"

#include <array>
#include <cstddef>
#include <initializer_list>

#include "runtime/renderer/mesh.h"
#include "runtime/renderer/pipeline_parts.h"
#include "runtime/renderer/shaders/frame.h"

namespace lightloom::renderer {
namespace {

// clang-format off
constexpr uint32_t kForwardVert[] =
#include "runtime/renderer/shaders/forward.vert.inc"
;
constexpr uint32_t kForwardFrag[] =
#include "runtime/renderer/shaders/forward.frag.inc"
;
constexpr uint32_t kShadowVert[] =
#include "runtime/renderer/shaders/shadow.vert.inc"
;
constexpr uint32_t kShadowMaskFrag[] =
#include "runtime/renderer/shaders/shadow_mask.frag.inc"
;
// clang-format on

struct Stage {
  VkPipelineLayout layout;
  std::span<const uint32_t> vertex, fragment;  ///< fragment may be empty
  std::initializer_list<uint32_t> locations;   ///< of the Vertex that the shader reads
  bool colour;                                 ///< else depth alone
  VkCompareOp depth_test;
};

/// Draws both sides: single-sided back faces block light and the view, too.
absl::StatusOr<Owned<VkPipeline>> pipeline(VkDevice device, const Stage& want) {
  static constexpr std::array<VkVertexInputAttributeDescription, 6> kAttributes{{
      {0, 0, VK_FORMAT_R32G32B32_SFLOAT, offsetof(Vertex, position)},
      {1, 0, VK_FORMAT_R32G32B32_SFLOAT, offsetof(Vertex, normal)},
      {2, 0, VK_FORMAT_R16G16B16A16_SNORM, offsetof(Vertex, geometric)},
      {3, 0, VK_FORMAT_R32G32_SFLOAT, offsetof(Vertex, base_uv)},
      {4, 0, VK_FORMAT_R32G32_SFLOAT, offsetof(Vertex, emission_uv)},
      {5, 0, VK_FORMAT_R32G32_SFLOAT, offsetof(Vertex, lightmap_uv)},
  }};
  GraphicsPipeline info;
  info.layout = want.layout;
  info.vertex = want.vertex;
  info.fragment = want.fragment;
  info.stride = sizeof(Vertex);
  for (const uint32_t location : want.locations) info.attributes.push_back(kAttributes[location]);
  info.colour = want.colour ? kColourFormat : VK_FORMAT_UNDEFINED;
  info.depth = kDepthFormat;
  info.depth_test = want.depth_test;
  return graphics_pipeline(device, info);
}

}  // namespace

absl::StatusOr<Pipelines> make_pipelines(const Gpu& gpu) {
  constexpr VkDescriptorType kUniform = VK_DESCRIPTOR_TYPE_UNIFORM_BUFFER;
  constexpr VkDescriptorType kStorage = VK_DESCRIPTOR_TYPE_STORAGE_BUFFER;
  constexpr VkDescriptorType kImage = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
  const VkDevice device = gpu.device();
  Pipelines p;
  LL_ASSIGN_OR_RETURN(p.frame_set, set_layout(device, {kUniform, kStorage, kStorage, kImage, kImage}));
  LL_ASSIGN_OR_RETURN(p.material_set, set_layout(device, {kImage, kImage}));
  LL_ASSIGN_OR_RETURN(p.forward_layout,
                      pipeline_layout(device, {p.frame_set.get(), p.material_set.get()}, sizeof(gpu::MaterialPush)));
  LL_ASSIGN_OR_RETURN(p.shadow_layout, pipeline_layout(device, {p.material_set.get()}, sizeof(gpu::ShadowPush)));
  LL_ASSIGN_OR_RETURN(
      p.forward,
      pipeline(device,
               {p.forward_layout.get(), kForwardVert, kForwardFrag, {0, 1, 2, 3, 4, 5}, true, VK_COMPARE_OP_GREATER}));
  LL_ASSIGN_OR_RETURN(p.shadow,
                      pipeline(device, {p.shadow_layout.get(), kShadowVert, {}, {0, 3}, false, VK_COMPARE_OP_LESS}));
  LL_ASSIGN_OR_RETURN(
      p.shadow_masked,
      pipeline(device, {p.shadow_layout.get(), kShadowVert, kShadowMaskFrag, {0, 3}, false, VK_COMPARE_OP_LESS}));
  return p;
}

}  // namespace lightloom::renderer
