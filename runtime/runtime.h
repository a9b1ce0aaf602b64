// What lightloom.h promises, in C++: absl::Status instead of result codes.
#pragma once

#include <memory>
#include <span>

#include "runtime/asset_source.h"
#include "runtime/include/lightloom.h"
#include "runtime/vulkan/gpu_asset.h"

namespace lightloom {

struct RuntimeOptions {
  bool validation = false, force_staging = false;
  uint64_t page_bytes = 0;  ///< 0: 64 MiB
  uint32_t max_groups = 0;  ///< 0: the device's limit
  Messages messages;
};

class Runtime {
 public:
  static absl::StatusOr<std::unique_ptr<Runtime>> create(const RuntimeOptions& options);
  ~Runtime();
  Runtime(const Runtime&) = delete;
  Runtime& operator=(const Runtime&) = delete;

  const Messages& messages() const { return messages_; }
  /// Null: nothing is loaded.
  const GpuAsset* asset() const { return asset_.get(); }

  absl::Status load(std::span<const uint8_t> manifest, ReadChunk read);
  void unload() { asset_ = nullptr; }

  // REQUIRES for all below: asset() is not null.
  absl::Status set(SurfaceArray array, std::span<const float> rgb);
  void set_environment(Vec3 radiance) { asset_->set_environment(radiance); }
  absl::Status update(uint32_t iterations);
  absl::Status read_irradiance(std::span<float> rgb);
  absl::Status reset_feedback();

  struct Stats {
    uint32_t frames = 0;
    bool timestamps = false;
    std::array<double, kPasses> milliseconds{};  ///< summed over the frames
  };
  const Stats& stats() const { return stats_; }

 private:
  Runtime() = default;
  absl::Status add_times(uint32_t frames, Stats* stats) const;

  Messages messages_;
  GpuLimits limits_;
  std::unique_ptr<Device> device_;
  VkQueryPool queries_ = VK_NULL_HANDLE;
  std::unique_ptr<Transfer> transfer_;
  std::unique_ptr<Pipelines> pipelines_;
  std::unique_ptr<GpuAsset> asset_;
  Stats stats_;
};

}  // namespace lightloom
