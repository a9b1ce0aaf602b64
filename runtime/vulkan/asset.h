// An asset on the device: which of its chunks are resident and where, the arrays of its surface elements, and the passes
// over them.
#pragma once

#include <array>
#include <memory>
#include <mutex>
#include <vector>

#include "runtime/backend.h"
#include "runtime/cell_block.h"
#include "runtime/include/lightloom_vulkan.h"
#include "runtime/lightmap_map.h"
#include "runtime/vulkan/frame_memory.h"
#include "runtime/vulkan/pools.h"
#include "runtime/vulkan/upload.h"

namespace lightloom {

struct AssetOptions {
  bool smoothing = false;
  VkFormat image_format = VK_FORMAT_UNDEFINED;
};

/// What may change how a frame goes, beside the arrays.
struct FrameSettings {
  lightloom_update_options options{};  ///< smoothing in (0, 1]
  Vec3 environment;
};

/// kUploads: only brings chunks and inputs to the device; E stays.
enum class FrameKind { kWhole, kUploads };

/// Threads: residency and set() from any, record() from one.
class VulkanAsset {
 public:
  static absl::StatusOr<std::unique_ptr<VulkanAsset>> create(Context* context, const Pipelines* pipelines,
                                                             std::shared_ptr<const AssetIndex> index,
                                                             const AssetOptions& options,
                                                             std::pmr::memory_resource* memory);

  /// Frees device memory, but for E. Then it is good for inherit() alone. REQUIRES: all recorded frames are finished.
  void free_all_but_light();
  /// Takes over inputs and E. Before the first frame.
  void inherit(VulkanAsset* before, std::span<const AssetIndex::Kept> kept);

  // As Backend's.
  bool resident(const AssetIndex::Target& target, const Detail& detail) const;
  absl::Status load_surface(uint32_t object, const SurfaceChunk& chunk);
  absl::Status load_relight(uint32_t probe, std::span<const uint32_t> rays, const Detail& detail);
  absl::Status load_cell(uint32_t cell, const SourceCell& source, const Detail& detail);
  void unload(const AssetIndex::Target& target);
  void drop_detail(const AssetIndex::Target& target);
  void set(SurfaceInput input, uint64_t first, std::span<const float> rgb);
  void set_environment(Vec3 radiance);
  void set_options(const lightloom_update_options& options);
  void reset_feedback();
  uint64_t pending_bytes() const;
  bool uploads_pending() const;  ///< anything that the device does not have yet

  /// Records one frame. `frame` counts from 1.
  absl::Status record(VkCommandBuffer commands, const lightloom_frame_info& info, uint32_t frame, FrameKind kind,
                      FrameMemory* memory);
  /// The counters of a frame that is finished.
  void finished(uint32_t frame, const gpu::Control& counters);

  void fill_counts(lightloom_counts* counts) const;
  void fill_stats(lightloom_stats* stats) const;
  const Buffer& irradiance() const { return irradiance_; }
  void fill_outputs(lightloom_vulkan_outputs* outputs) const;

 private:
  /// A relight set or a cell in some detail. One lights the level; another one may be on its way to replace it.
  struct LitProbe {
    Detail detail;
    uint32_t slot = 0;
  };
  struct LitCell {
    Detail detail;
    CellPools::Place place;
    uint32_t jobs = 0, octets = 0, project_quads = 0, receive_quads = 0;
  };
  template <class Lit>
  struct Resident {
    std::optional<Lit> now, next;
    std::optional<Lit> base;  ///< beneath `now`
    const Lit* newest() const { return next ? &*next : now ? &*now : nullptr; }
    bool has(const Detail& detail) const;
    absl::Status check(const Detail& detail) const;  ///< whether another detail may be loaded
  };
  struct Probe : Resident<LitProbe> {};
  struct Cell : Resident<LitCell> {
    gpu::Cell record{};
    std::pmr::vector<uint32_t> elements;  ///< of its receivers
  };
  /// Memory that frames in flight may still use.
  struct Grave {
    uint32_t frame;  ///< the first that no longer uses it
    std::optional<uint32_t> slot;
    CellPools::Place place;
  };

  VulkanAsset(Context* context, const Pipelines* pipelines, std::shared_ptr<const AssetIndex> index,
              const AssetOptions& options, std::pmr::memory_resource* memory);
  absl::Status create_arrays();
  absl::Status create_sets();

  void unload_surface(uint32_t object);
  void unload_relight(uint32_t probe);
  void unload_cell(uint32_t cell);
  void drop_relight_detail(uint32_t probe);
  void drop_cell_detail(uint32_t cell);
  absl::Status mark_received(uint32_t cell, const std::vector<uint32_t>& elements);
  absl::StatusOr<LitCell> place_cell(const CellBlock& block);
  void bury(const LitProbe& probe);
  void bury(const LitCell& cell);
  void make_room_for_graves();
  template <class Lit>
  void bury_all(Resident<Lit>* resident);
  template <class Lit>
  void take_next(Resident<Lit>* resident);
  template <class Lit>
  void drop_next(const AssetIndex::Target& target, Resident<Lit>* resident);
  void uploaded(AssetIndex::Target target);
  void write_slot(uint32_t slot, uint32_t probe);
  /// Brings the device's record of the cell up to date; `anew`: what it computes from is another model than before.
  void refresh_cell(uint32_t cell, bool anew);
  void touch() { touched_ = true; }

  void free_graves(uint32_t frame);
  float settle_share() const;
  bool tables_pending() const;
  bool nothing_to_do(const lightloom_frame_info& info, uint32_t frame);
  absl::Status record_uploads(VkCommandBuffer commands, uint32_t frame, FrameMemory* memory);
  void record_clears(VkCommandBuffer commands);
  absl::Status record_direct(VkCommandBuffer commands, const lightloom_frame_info& info, uint32_t frame,
                             FrameMemory* memory);
  void record_radiosity(VkCommandBuffer commands, uint32_t frame);
  void record_select_and_relight(VkCommandBuffer commands, uint32_t frame, FrameMemory* memory);
  void record_cells(VkCommandBuffer commands, uint32_t frame, FrameMemory* memory);
  void record_settle(VkCommandBuffer commands, float share);
  void record_image(VkCommandBuffer commands);
  void dispatch_indirect(VkCommandBuffer commands, size_t offset) const;

  Context* context_;
  const Pipelines* pipelines_;
  std::pmr::memory_resource* memory_;
  const std::shared_ptr<const AssetIndex> shared_index_;
  const AssetIndex& index_;
  const AssetOptions options_;
  const uint32_t stride_;  ///< sh_stride
  uint32_t tile_shift_ = 6, tile_words_ = 0, sky_tile_ = 0;

  mutable std::mutex mutex_;  ///< guards all below
  std::array<ShadowTable, 3> inputs_;
  ShadowTable cell_table_, slot_table_, map_table_;
  ShadowTable near_table_;                          ///< per cell: the tiles of its near fields, a bit each
  Buffer inherited_;                                ///< E of the asset before this
  std::pmr::vector<VkBufferCopy> inherited_parts_;  ///< of it that the first frame copies
  uint32_t inherited_until_ = 0;                    ///< the frame that frees it; 0: not copied yet
  Buffer irradiance_;                               ///< with smoothing followed by where each E goes
  Buffer radiosity_, points_, normals_, lambda_, changed_, dirty_, slot_seen_, stamps_;
  std::array<Buffer, 2> sh_;  ///< of every ray, and of the coarse sets'
  Buffer active_slots_, cell_probes_, cell_dirty_, cell_seen_, active_cells_, control_;
  DeviceImage image_;
  std::unique_ptr<DescriptorSets> sets_;
  std::vector<VkDescriptorSet> radiosity_sets_, direct_sets_, shadowed_sets_;  ///< per frame in flight
  std::vector<VkDescriptorBufferInfo> bound_direct_;                           ///< what radiosity_sets_ bind
  VkDescriptorBufferInfo direct_source_{};                                     ///< of the newest frame
  VkDescriptorSet select_probes_ = VK_NULL_HANDLE, mark_cells_ = VK_NULL_HANDLE, select_cells_ = VK_NULL_HANDLE;
  VkDescriptorSet settle_ = VK_NULL_HANDLE, image_set_ = VK_NULL_HANDLE;
  std::unique_ptr<CellPools> cell_pools_;
  std::unique_ptr<RelightPools> relight_pools_;

  std::pmr::vector<uint32_t> coarse_rays_;
  std::pmr::vector<bool> surfaces_;  ///< per object: resident
  std::pmr::vector<Probe> probes_;
  std::pmr::vector<Cell> cells_;
  std::pmr::vector<bool> received_;  ///< per surface element
  std::unique_ptr<LightmapMap> map_;
  uint32_t map_layers_ = 1;
  UploadQueue uploads_;
  std::pmr::vector<Grave> graves_;  ///< by frame; with room for what the uploads will replace

  FrameSettings settings_;
  uint32_t generation_ = 0;
  uint32_t recorded_ = 0;     ///< the newest frame
  bool cleared_ = false;      ///< arrays are initialised
  bool reset_ = false;        ///< E is to be set to 0
  bool image_stale_ = true;   ///< all of the image is to be written
  float exposure_ = 1;        ///< of the image
  bool smooth_ = false;       ///< targets hold what E goes towards
  uint64_t chunk_bytes_ = 0;  ///< that the newest frame copies
  uint32_t lit_ = 0;          ///< versions of cells and probes, each of which is buried once
  double fade_left_ = 0;      ///< share of the last change of the model that is not shown yet; 0: none
  bool sky_changed_ = true;
  bool direct_overwritten_ = false;  ///< the direct pass wrote where the host's values were
  bool touched_ = true;              ///< something that the next frame must look at
  bool quiet_ = false;               ///< a finished frame proved that there is nothing to do
  uint32_t touched_frame_ = 0;       ///< the newest frame that something was new to

  gpu::Control last_{};  ///< counters of the newest finished frame
  uint32_t last_frame_ = 0, skipped_frame_ = 0;
};

}  // namespace lightloom
