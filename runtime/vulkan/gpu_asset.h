// A loaded asset on the device, and the commands of its frame: radiosity → relight → project → receive.
#pragma once

#include <array>
#include <memory>
#include <vector>

#include "runtime/asset_layout.h"
#include "runtime/asset_source.h"
#include "runtime/vulkan/buffer.h"
#include "runtime/vulkan/pipeline.h"

namespace lightloom {

struct GpuLimits {
  uint64_t page_bytes = 0;  ///< largest buffer of asset data
  uint32_t max_groups = 0;  ///< per dispatch dimension
  bool force_staging = false;
};

/// Floats per surface element that the caller sets each frame, or reads.
enum class SurfaceArray { kDirect, kAlbedo, kEmission, kIrradiance };
inline constexpr size_t kSurfaceArrays = 4;

class GpuAsset {
 public:
  /// Reads and uploads everything. The device, transfer and pipelines must outlive it.
  static absl::StatusOr<std::unique_ptr<GpuAsset>> load(Device* device, Transfer* transfer, const Pipelines* pipelines,
                                                        const AssetSource& source, const GpuLimits& limits);

  struct Counts {
    uint32_t surface_elements = 0, receivers = 0, probes = 0, cells = 0, clusters = 0, pages = 0, order = 0;
    uint64_t gpu_bytes = 0;
    uint64_t relight_bytes = 0, project_bytes = 0, receive_bytes = 0;  ///< asset bytes that each pass reads
  };
  const Counts& counts() const { return counts_; }
  const Buffer& array(SurfaceArray a) const { return arrays_[static_cast<size_t>(a)]; }
  void set_environment(Vec3 radiance) { environment_ = radiance; }

  /// One frame: E from E. Writes a time stamp before each pass and after the last (kPasses + 1) if `queries`
  /// is not null. Ends with a barrier to the next frame, not to all.
  void record_frame(VkCommandBuffer commands, VkQueryPool queries, uint32_t first_query) const;

 private:
  struct Page {
    Buffer data, coefficients;
    PageLayout layout;
    VkDescriptorSet project = VK_NULL_HANDLE, receive = VK_NULL_HANDLE;
  };
  struct RelightPage {
    Buffer rays;
    uint32_t first_probe = 0, probes = 0;
    VkDescriptorSet set = VK_NULL_HANDLE;
  };

  GpuAsset(Device* device, Transfer* transfer, const Pipelines* pipelines, const GpuLimits& limits)
      : device_(device),
        transfer_(transfer),
        pipelines_(pipelines),
        limits_(limits),
        arena_(device, limits.force_staging ? MemoryUse::kDeviceUnmapped : MemoryUse::kDevice) {}
  absl::Status create_surface(const AssetSource& source);
  absl::Status load_relight(const AssetSource& source);
  absl::Status load_cells(const AssetSource& source);
  absl::Status finish_page(PageBuilder* builder);
  absl::Status create_sets();
  void dispatch_relight(VkCommandBuffer commands) const;

  Device* device_;
  Transfer* transfer_;
  const Pipelines* pipelines_;
  GpuLimits limits_;
  Counts counts_;
  uint32_t rays_ = 0, stride_ = 0;
  Vec3 environment_;
  Arena arena_;
  std::array<Buffer, kSurfaceArrays> arrays_;  ///< S × 3 floats each
  Buffer radiosity_;                           ///< S × vec4
  Buffer sh_;                                  ///< N × stride floats
  Buffer lambda_;                              ///< probes × 3 × stride floats
  std::vector<RelightPage> relight_pages_;
  std::vector<Page> pages_;
  std::unique_ptr<DescriptorSets> sets_;
  VkDescriptorSet radiosity_set_ = VK_NULL_HANDLE;
};

}  // namespace lightloom
