// The Vulkan passes behind the C API.
#pragma once

#include <memory>

#include "runtime/vulkan/asset.h"
#include "runtime/vulkan/own_queue.h"

namespace lightloom {

class VulkanBackend final : public Backend {
 public:
  /// `info` is checked; its defaults are not filled in. InvalidArgument, OutOfRange (a feature is missing),
  /// ResourceExhausted.
  static absl::StatusOr<std::unique_ptr<VulkanBackend>> create(const lightloom_vulkan_create_info& info,
                                                               std::pmr::memory_resource* memory);
  /// A device of its own, which it owns from then on (also if this fails), and update() and read_irradiance().
  absl::Status own(const lightloom_vulkan_device& device);
  ~VulkanBackend() override;

  void unload() override;
  void set(SurfaceInput input, uint64_t first, std::span<const float> rgb) override { asset_->set(input, first, rgb); }
  void set_environment(Vec3 radiance) override { asset_->set_environment(radiance); }
  absl::Status set_options(const lightloom_update_options& options) override;
  void reset_feedback() override { asset_->reset_feedback(); }
  absl::Status update(uint32_t frames) override;
  absl::Status read_irradiance(std::span<float> rgb) override;
  lightloom_counts counts() const override;
  lightloom_stats stats() const override;
  uint64_t pending_bytes() const override { return asset_->pending_bytes(); }

  // REQUIRES: loaded().
  absl::Status record(VkCommandBuffer commands, const lightloom_frame_info& info, FrameKind kind = FrameKind::kWhole);
  void fill_outputs(lightloom_vulkan_outputs* outputs) const { asset_->fill_outputs(outputs); }

 protected:
  absl::Status start(std::shared_ptr<const AssetIndex> index, std::span<const AssetIndex::Kept> kept) override;
  bool resident(const AssetIndex::Target& target, const Detail& detail) const override {
    return asset_->resident(target, detail);
  }
  absl::Status load_surface(uint32_t object, const SurfaceChunk& chunk) override {
    return asset_->load_surface(object, chunk);
  }
  absl::Status load_relight(uint32_t probe, std::span<const uint32_t> rays, const Detail& detail) override {
    return asset_->load_relight(probe, rays, detail);
  }
  absl::Status load_cell(uint32_t cell, const SourceCell& source, const Detail& detail) override {
    return asset_->load_cell(cell, source, detail);
  }
  void unload_target(const AssetIndex::Target& target) override { asset_->unload(target); }
  void drop_target_detail(const AssetIndex::Target& target) override { asset_->drop_detail(target); }

 private:
  explicit VulkanBackend(std::pmr::memory_resource* memory) : Backend(memory) {}
  void forget_frames();
  absl::Status take(uint32_t frame);
  absl::Status run_frames(uint32_t frames, FrameKind kind);

  Context context_;
  AssetOptions asset_options_;
  lightloom_vulkan_device own_device_{};
  std::unique_ptr<OwnQueue> queue_;
  std::unique_ptr<Pipelines> pipelines_;
  std::unique_ptr<FrameMemory> frame_memory_;
  std::unique_ptr<VulkanAsset> asset_;
  lightloom_update_options options_{};
  uint32_t frame_ = 0, taken_ = 0;  ///< the newest that is recorded, whose results are taken

  mutable std::mutex stats_mutex_;
  lightloom_stats stats_{};
};

}  // namespace lightloom
