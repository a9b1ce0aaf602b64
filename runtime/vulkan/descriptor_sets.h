// Descriptor sets of an asset; freed together.
#pragma once

#include <memory>
#include <span>

#include "runtime/vulkan/pipelines.h"

namespace lightloom {

class DescriptorSets {
 public:
  struct Demand {
    Pass pass;
    uint32_t sets;
  };
  static absl::StatusOr<std::unique_ptr<DescriptorSets>> create(Context* context, const Pipelines* pipelines,
                                                                std::span<const Demand> demands);
  ~DescriptorSets();
  DescriptorSets(const DescriptorSets&) = delete;
  DescriptorSets& operator=(const DescriptorSets&) = delete;

  absl::StatusOr<VkDescriptorSet> allocate(Pass pass);
  /// The pass's buffers, then its image if it has one. REQUIRES: no frame in flight uses the set.
  void write(VkDescriptorSet set, Pass pass, std::span<const VkDescriptorBufferInfo> buffers,
             const VkDescriptorImageInfo* image = nullptr) const;
  /// Both.
  absl::StatusOr<VkDescriptorSet> make(Pass pass, std::span<const VkDescriptorBufferInfo> buffers,
                                       const VkDescriptorImageInfo* image = nullptr);

 private:
  DescriptorSets(Context* context, const Pipelines* pipelines) : context_(context), pipelines_(pipelines) {}
  Context* context_;
  const Pipelines* pipelines_;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
};

}  // namespace lightloom
