// The compute passes of a frame: their pipelines and what they bind.
#pragma once

#include <vulkan/vulkan.h>

#include <array>
#include <memory>
#include <span>

#include "runtime/vulkan/buffer.h"
#include "runtime/vulkan/device.h"

namespace lightloom {

enum class Pass { kRadiosity, kRelight, kProject, kReceive };
inline constexpr size_t kPasses = 4;

class Pipelines {
 public:
  static absl::StatusOr<std::unique_ptr<Pipelines>> create(Device* device);
  ~Pipelines();
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;

  VkDescriptorSetLayout set_layout(Pass pass) const { return entries_[static_cast<size_t>(pass)].set_layout; }

  /// Binds the pass and dispatches `groups` workgroups, at most `max_groups` along a dimension. `push` is the
  /// pass's push constants of shaders/layout.h.
  template <class Push>
  void dispatch(VkCommandBuffer commands, Pass pass, VkDescriptorSet set, const Push& push, uint64_t groups,
                uint32_t max_groups) const {
    dispatch(commands, pass, set, &push, sizeof push, groups, max_groups);
  }

 private:
  struct Entry {
    VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkPipeline pipeline = VK_NULL_HANDLE;
  };
  explicit Pipelines(Device* device) : device_(device) {}
  absl::Status create_entry(Pass pass);
  void dispatch(VkCommandBuffer commands, Pass pass, VkDescriptorSet set, const void* push, uint32_t push_bytes,
                uint64_t groups, uint32_t max_groups) const;

  Device* device_;
  std::array<Entry, kPasses> entries_;
};

/// Storage buffers that the pass binds, at bindings 0..n-1.
uint32_t pass_bindings(Pass pass);

/// Descriptor sets of one asset; freed together.
class DescriptorSets {
 public:
  /// Room for one set per entry of `passes`.
  static absl::StatusOr<std::unique_ptr<DescriptorSets>> create(Device* device, std::span<const Pass> passes);
  ~DescriptorSets();
  DescriptorSets(const DescriptorSets&) = delete;
  DescriptorSets& operator=(const DescriptorSets&) = delete;

  /// REQUIRES: ranges.size() == pass_bindings(pass).
  absl::StatusOr<VkDescriptorSet> set(const Pipelines& pipelines, Pass pass,
                                      std::span<const VkDescriptorBufferInfo> ranges);

 private:
  explicit DescriptorSets(Device* device) : device_(device) {}
  Device* device_;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
};

}  // namespace lightloom
