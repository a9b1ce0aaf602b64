// The compute passes of a frame: their pipelines and what they bind.
#pragma once

#include <array>
#include <memory>
#include <span>

#include "runtime/shaders/layout.h"
#include "runtime/vulkan/buffer.h"

namespace lightloom {

enum class Pass {
  kDirect,
  kDirectShadowed,
  kRadiosity,
  kMark,
  kSelectProbes,
  kRelight,
  kMarkCells,
  kSelectCells,
  kProject,
  kReceive,
  kSettle,
  kImage16,
  kImage32,
};
inline constexpr size_t kPasses = 13;
inline constexpr uint32_t kMaxBindings = 7;
inline constexpr uint32_t kMaxPushBytes = 48;

/// A pass's bindings 0..n-1: storage buffers, then at most one of the others.
struct PassBindings {
  uint32_t buffers;
  bool storage_image, sampler;
};
PassBindings bindings_of(Pass pass);

class Pipelines {
 public:
  static absl::StatusOr<std::unique_ptr<Pipelines>> create(Context* context);
  ~Pipelines();
  Pipelines(const Pipelines&) = delete;
  Pipelines& operator=(const Pipelines&) = delete;

  VkDescriptorSetLayout set_layout(Pass pass) const { return entries_[static_cast<size_t>(pass)].set_layout; }
  /// For shadow maps: compares, clamps.
  VkSampler sampler() const { return sampler_; }

  /// Binds the pass with its push constants of shaders/layout.h.
  template <class Push>
  void bind(VkCommandBuffer commands, Pass pass, VkDescriptorSet set, const Push& push) const {
    static_assert(sizeof push <= kMaxPushBytes);
    bind(commands, pass, set, &push, sizeof push);
  }
  /// Dispatches `groups` workgroups of the bound pass.
  void dispatch(VkCommandBuffer commands, uint64_t groups) const;
  uint64_t groups_of(uint64_t invocations) const { return (invocations + context_->group - 1) / context_->group; }

 private:
  struct Entry {
    VkDescriptorSetLayout set_layout = VK_NULL_HANDLE;
    VkPipelineLayout layout = VK_NULL_HANDLE;
    VkPipeline pipeline = VK_NULL_HANDLE;
  };
  explicit Pipelines(Context* context) : context_(context) {}
  absl::Status create_sampler();
  absl::Status create_entry(Pass pass);
  void bind(VkCommandBuffer commands, Pass pass, VkDescriptorSet set, const void* push, uint32_t push_bytes) const;

  Context* context_;
  VkSampler sampler_ = VK_NULL_HANDLE;
  std::array<Entry, kPasses> entries_;
};

}  // namespace lightloom
