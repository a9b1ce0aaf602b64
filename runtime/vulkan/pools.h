// Device buffers that chunks lie in: cells as blocks of any size, relight sets in slots of one size. REQUIRES of all:
// the asset's mutex is held.
#pragma once

#include <array>
#include <deque>
#include <optional>

#include "runtime/block_allocator.h"
#include "runtime/vulkan/descriptor_sets.h"

namespace lightloom {

/// What pools' descriptor sets bind besides the pool.
struct PoolBindings {
  const Buffer *lambda, *active_cells, *control, *irradiance;
  const Buffer *slots, *changed, *dirty, *radiosity, *active_slots;
};

class CellPools {
 public:
  struct Pool {
    Buffer buffer;
    std::optional<BlockAllocator> blocks;
    uint32_t retired = 0;  ///< 0, or the frame from which on it is freed; no frame uses it meanwhile
    bool in_use() const { return buffer.exists() && retired == 0; }
    VkDescriptorSet project = VK_NULL_HANDLE, receive = VK_NULL_HANDLE;
  };
  struct Place {
    uint32_t pool = 0;
    uint64_t offset = 0, bytes = 0;
  };

  /// `total_bytes`: about what all cells of the asset take.
  CellPools(Context* context, DescriptorSets* sets, const PoolBindings& bindings, uint64_t total_bytes,
            std::pmr::memory_resource* memory);

  /// over_budget() or Unimplemented if there is no room; then nothing has changed.
  absl::StatusOr<Place> allocate(uint64_t bytes);
  /// REQUIRES: no frame in flight reads the place. `frame` is recorded next.
  void release(const Place& place, uint32_t frame);
  /// Frees pools that are empty for so long that no frame in flight binds them.
  void free_retired(uint32_t frame);
  std::span<const Pool> pools() const { return pools_; }
  uint32_t count() const;

 private:
  absl::Status create(Pool* pool, uint64_t least);

  Context* context_;
  DescriptorSets* sets_;
  PoolBindings bindings_;
  uint64_t total_bytes_;
  std::pmr::memory_resource* memory_;
  std::array<Pool, gpu::kMaxPools> pools_;
};

/// Relight sets of some number of rays, and their Y_j(ω_r) on the device.
struct RelightRays {
  uint32_t rays = 0;
  const Buffer* sh = nullptr;
};

/// One pool's slots all hold sets of as many rays; the pools of each number of rays follow each other, and so do their
/// slots.
class RelightPools {
 public:
  struct Pool {
    Buffer buffer;
    uint32_t kind = 0;  ///< which of the RelightRays
    uint64_t slot_bytes = 0;
    uint32_t slots = 0, used = 0;
    uint32_t retired = 0;  ///< as above
    bool in_use() const { return buffer.exists() && retired == 0; }
    VkDescriptorSet mark = VK_NULL_HANDLE, relight = VK_NULL_HANDLE;
  };

  /// Room for each of `probes` in each kind, and for some twice: the old set is lit until the new one is there.
  /// `bindings` and `kinds` may be made after this, but before allocate().
  RelightPools(Context* context, std::span<const RelightRays> kinds, uint32_t tile_words, uint32_t probes,
               std::pmr::memory_resource* memory);
  void bind(DescriptorSets* sets, const PoolBindings& bindings) { sets_ = sets, bindings_ = bindings; }

  uint32_t rays(uint32_t kind) const { return kinds_[kind].rays; }
  uint32_t kinds() const { return static_cast<uint32_t>(kinds_.size()); }
  uint32_t slots() const { return kinds() * pools_per_kind_ * pool_slots_; }
  uint32_t pool_slots() const { return pool_slots_; }
  /// From this pool on they are of the second kind.
  uint32_t coarse_pool() const { return pools_per_kind_; }
  /// Unimplemented: so many probes do not fit into kMaxPools.
  absl::Status check() const;

  absl::StatusOr<uint32_t> allocate(uint32_t kind);
  void release(uint32_t slot, uint32_t frame);
  void free_retired(uint32_t frame);
  VkBuffer buffer_of(uint32_t slot) const { return pools_[slot / pool_slots_].buffer.handle(); }
  uint64_t offset_of(uint32_t slot) const { return slot % pool_slots_ * pools_[slot / pool_slots_].slot_bytes; }
  std::span<const Pool> pools() const { return pools_; }

 private:
  absl::Status create(Pool* pool);

  Context* context_;
  DescriptorSets* sets_ = nullptr;
  PoolBindings bindings_{};
  std::pmr::vector<RelightRays> kinds_;
  uint32_t probes_, pool_slots_ = 0, pools_per_kind_ = 0;
  std::pmr::vector<std::pmr::vector<uint32_t>> free_;  ///< per kind; the last is taken next
  std::array<Pool, gpu::kMaxPools> pools_;
};

}  // namespace lightloom
