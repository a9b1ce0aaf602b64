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
  const Buffer *lambda, *active_cells, *control, *irradiance, *target;  ///< target: null without smoothing
  const Buffer *slots, *changed, *dirty, *radiosity, *sh, *active_slots;
};

class CellPools {
 public:
  struct Pool {
    Buffer buffer;
    std::optional<BlockAllocator> blocks;
    VkDescriptorSet project = VK_NULL_HANDLE, receive = VK_NULL_HANDLE, receive_target = VK_NULL_HANDLE;
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
  void release(const Place& place);
  std::span<const Pool> pools() const { return pools_; }
  uint32_t count() const;

 private:
  absl::Status create(Pool* pool, uint64_t least);

  Context* context_;
  DescriptorSets* sets_;
  PoolBindings bindings_;
  uint64_t total_bytes_, pool_bytes_ = 0;
  std::pmr::memory_resource* memory_;
  std::array<Pool, gpu::kMaxPools> pools_;
};

class RelightPools {
 public:
  struct Pool {
    Buffer buffer;
    uint32_t slots = 0, used = 0;
    VkDescriptorSet mark = VK_NULL_HANDLE, relight = VK_NULL_HANDLE;
  };

  RelightPools(Context* context, DescriptorSets* sets, const PoolBindings& bindings, uint64_t slot_bytes,
               uint32_t probes, std::pmr::memory_resource* memory);

  uint64_t slot_bytes() const { return slot_bytes_; }
  uint32_t slots() const { return slots_; }
  uint32_t pool_slots() const { return pool_slots_; }
  /// Unimplemented: so many probes do not fit into kMaxPools.
  absl::Status check() const;

  absl::StatusOr<uint32_t> allocate();
  void release(uint32_t slot);
  VkBuffer buffer_of(uint32_t slot) const { return pools_[slot / pool_slots_].buffer.handle(); }
  uint64_t offset_of(uint32_t slot) const { return slot % pool_slots_ * slot_bytes_; }
  std::span<const Pool> pools() const { return pools_; }

 private:
  absl::Status create(Pool* pool);

  Context* context_;
  DescriptorSets* sets_;
  PoolBindings bindings_;
  uint64_t slot_bytes_;
  uint32_t slots_, pool_slots_;
  std::pmr::vector<uint32_t> free_;  ///< the last is taken next
  std::array<Pool, gpu::kMaxPools> pools_;
};

}  // namespace lightloom
