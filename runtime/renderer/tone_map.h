// Radiance as a screen shows it: exposure, tone map and sRGB as core/scene/picture.h has them, on the device.
#pragma once

#include "runtime/renderer/gpu.h"

namespace lightloom::renderer {

class ToneMap {
 public:
  /// `format` of the targets: 8-bit, not sRGB, since the encoding is done here.
  static absl::StatusOr<ToneMap> create(const Gpu& gpu, VkFormat format);

  /// Nothing recorded may be running.
  void set_source(const Texture2D& radiance) const;
  /// Draws the source, which is kSampled, over all of `target`, of the same size. Exposure 0 shows values as they are.
  /// Leaves the target as kColour.
  void record(VkCommandBuffer commands, const Texture2D& target, float exposure) const;

 private:
  VkDevice device_ = VK_NULL_HANDLE;
  Owned<VkDescriptorSetLayout> set_layout_;
  Owned<VkPipelineLayout> layout_;
  Owned<VkPipeline> pipeline_;
  Owned<VkSampler> sampler_;
  Owned<VkDescriptorPool> pool_;
  VkDescriptorSet set_ = VK_NULL_HANDLE;
};

}  // namespace lightloom::renderer
