#include "runtime/renderer/materials.h"

#include <algorithm>
#include <array>
#include <bit>

#include "runtime/renderer/status.h"

namespace lightloom::renderer {
namespace {

absl::StatusOr<Texture2D> upload(Gpu& gpu, const Texture& texture) {
  TextureInfo info;
  info.format = texture.srgb ? VK_FORMAT_R8G8B8A8_SRGB : VK_FORMAT_R8G8B8A8_UNORM;
  info.width = static_cast<uint32_t>(texture.width);
  info.height = static_cast<uint32_t>(texture.height);
  info.levels = static_cast<uint32_t>(std::bit_width(std::max(info.width, info.height)));
  info.usage = VK_IMAGE_USAGE_SAMPLED_BIT | VK_IMAGE_USAGE_TRANSFER_SRC_BIT | VK_IMAGE_USAGE_TRANSFER_DST_BIT;
  LL_ASSIGN_OR_RETURN(Texture2D out, gpu.texture(info));
  LL_RETURN_IF_ERROR(gpu.fill(out, texture.rgba));
  return out;
}

VkSamplerAddressMode address_mode(Wrap wrap) {
  switch (wrap) {
    case Wrap::kClamp:
      return VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
    case Wrap::kMirror:
      return VK_SAMPLER_ADDRESS_MODE_MIRRORED_REPEAT;
    case Wrap::kRepeat:
      break;
  }
  return VK_SAMPLER_ADDRESS_MODE_REPEAT;
}

absl::StatusOr<Owned<VkSampler>> sampler(const Gpu& gpu, const Texture& texture) {
  auto info = vulkan_struct<VkSamplerCreateInfo>(VK_STRUCTURE_TYPE_SAMPLER_CREATE_INFO);
  info.magFilter = VK_FILTER_LINEAR;
  info.minFilter = VK_FILTER_LINEAR;
  info.mipmapMode = VK_SAMPLER_MIPMAP_MODE_LINEAR;
  info.addressModeU = address_mode(texture.wrap_s);
  info.addressModeV = address_mode(texture.wrap_t);
  info.addressModeW = VK_SAMPLER_ADDRESS_MODE_CLAMP_TO_EDGE;
  info.maxLod = VK_LOD_CLAMP_NONE;
  VkSampler handle = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateSampler", vkCreateSampler(gpu.device(), &info, nullptr, &handle));
  return Owned<VkSampler>(gpu.device(), handle, vkDestroySampler);
}

/// For materials without a texture.
Texture white() {
  Texture texture;
  texture.width = texture.height = 1;
  texture.rgba = {255, 255, 255, 255};
  return texture;
}

}  // namespace

absl::StatusOr<Materials> Materials::create(Gpu& gpu, const Scene& scene, VkDescriptorSetLayout layout) {
  Materials out;
  const Texture fallback = white();
  for (size_t i = 0; i <= scene.textures.size(); ++i) {
    const Texture& texture = i < scene.textures.size() ? scene.textures[i] : fallback;
    LL_ASSIGN_OR_RETURN(Texture2D image, upload(gpu, texture));
    out.textures_.push_back(std::move(image));
    LL_ASSIGN_OR_RETURN(Owned<VkSampler> made, sampler(gpu, texture));
    out.samplers_.push_back(std::move(made));
  }

  const auto count = static_cast<uint32_t>(std::max<size_t>(1, scene.materials.size()));
  const VkDescriptorPoolSize size{VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER, 2 * count};
  auto info = vulkan_struct<VkDescriptorPoolCreateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_POOL_CREATE_INFO);
  info.maxSets = count;
  info.poolSizeCount = 1;
  info.pPoolSizes = &size;
  VkDescriptorPool pool = VK_NULL_HANDLE;
  LL_VK_RETURN_IF_ERROR("vkCreateDescriptorPool", vkCreateDescriptorPool(gpu.device(), &info, nullptr, &pool));
  out.pool_ = {gpu.device(), pool, vkDestroyDescriptorPool};

  out.sets_.resize(scene.materials.size());
  for (size_t m = 0; m < scene.materials.size(); ++m) {
    auto allocate = vulkan_struct<VkDescriptorSetAllocateInfo>(VK_STRUCTURE_TYPE_DESCRIPTOR_SET_ALLOCATE_INFO);
    allocate.descriptorPool = pool;
    allocate.descriptorSetCount = 1;
    allocate.pSetLayouts = &layout;
    LL_VK_RETURN_IF_ERROR("vkAllocateDescriptorSets", vkAllocateDescriptorSets(gpu.device(), &allocate, &out.sets_[m]));
    const std::array<int, 2> textures{scene.materials[m].base_color_texture, scene.materials[m].emission_texture};
    std::array<VkDescriptorImageInfo, 2> images;
    std::array<VkWriteDescriptorSet, 2> writes;
    for (uint32_t b = 0; b < 2; ++b) {
      const size_t t = textures[b] >= 0 ? static_cast<size_t>(textures[b]) : scene.textures.size();
      images[b] = {out.samplers_[t].get(), out.textures_[t].view.get(), kSampled.layout};
      writes[b] = vulkan_struct<VkWriteDescriptorSet>(VK_STRUCTURE_TYPE_WRITE_DESCRIPTOR_SET);
      writes[b].dstSet = out.sets_[m];
      writes[b].dstBinding = b;
      writes[b].descriptorCount = 1;
      writes[b].descriptorType = VK_DESCRIPTOR_TYPE_COMBINED_IMAGE_SAMPLER;
      writes[b].pImageInfo = &images[b];
    }
    vkUpdateDescriptorSets(gpu.device(), 2, writes.data(), 0, nullptr);
  }
  return out;
}

gpu::MaterialPush material_push(const Material& m) {
  const bool mask = m.alpha_mode == AlphaMode::kMask;
  return {{m.base_color.x, m.base_color.y, m.base_color.z, m.alpha},
          {m.emission.x, m.emission.y, m.emission.z, mask ? m.alpha_cutoff : -1},
          m.double_sided ? 1u : 0u};
}

}  // namespace lightloom::renderer
