// The level's textures on the device, and one descriptor set per material: no descriptor indexing is needed.
#pragma once

#include <vector>

#include "core/scene/scene.h"
#include "runtime/renderer/gpu.h"
#include "runtime/renderer/shaders/frame.h"

namespace lightloom::renderer {

class Materials {
 public:
  static absl::StatusOr<Materials> create(Gpu& gpu, const Scene& scene, VkDescriptorSetLayout layout);

  VkDescriptorSet set(uint32_t material) const { return sets_[material]; }

 private:
  std::vector<Texture2D> textures_;  ///< the scene's, then a white one
  std::vector<Owned<VkSampler>> samplers_;
  Owned<VkDescriptorPool> pool_;
  std::vector<VkDescriptorSet> sets_;
};

/// The factors of a material as it is now.
gpu::MaterialPush material_push(const Material& material);

}  // namespace lightloom::renderer
