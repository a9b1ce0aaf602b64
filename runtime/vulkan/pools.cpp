#include "runtime/vulkan/pools.h"

#include <algorithm>

#include "runtime/boundary.h"

namespace lightloom {
namespace {

/// Unless the whole asset is smaller, or the caller's pages are.
constexpr uint64_t kLeastPage = 1 << 20;

uint64_t rounded_up(uint64_t n, uint64_t to) { return (n + to - 1) / to * to; }

}  // namespace

CellPools::CellPools(Context* context, DescriptorSets* sets, const PoolBindings& bindings, uint64_t total_bytes,
                     std::pmr::memory_resource* memory)
    : context_(context), sets_(sets), bindings_(bindings), total_bytes_(total_bytes), memory_(memory) {}

uint32_t CellPools::count() const {
  return static_cast<uint32_t>(
      std::count_if(pools_.begin(), pools_.end(), [](const Pool& p) { return p.buffer.exists(); }));
}

absl::StatusOr<CellPools::Place> CellPools::allocate(uint64_t bytes) {
  Pool* unused = nullptr;
  for (Pool& pool : pools_) {
    if (!pool.buffer.exists()) {
      if (unused == nullptr) unused = &pool;
      continue;
    }
    if (const auto offset = pool.blocks->allocate(bytes)) {
      pool.retired = 0;
      return Place{static_cast<uint32_t>(&pool - pools_.data()), *offset, bytes};
    }
  }
  if (unused == nullptr) {
    return not_ready(std::to_string(gpu::kMaxPools) + " pages of cells are in use; unload some, record " +
                     "frames_in_flight more frames, or create with larger pages");
  }
  LL_RETURN_IF_ERROR(create(unused, bytes));
  return Place{static_cast<uint32_t>(unused - pools_.data()), *unused->blocks->allocate(bytes), bytes};
}

absl::Status CellPools::create(Pool* pool, uint64_t least) {
  // An eighth of what the whole asset needs: who keeps a part of it resident shall not pay for all.
  uint64_t bytes = std::min(std::max(total_bytes_ / 8, kLeastPage), context_->page_bytes);
  if (context_->budget != 0) bytes = std::min(bytes, context_->budget - std::min(context_->budget, context_->bytes));
  bytes = std::max(bytes, least) / gpu::kCellUnit * gpu::kCellUnit;

  for (auto [set, pass] : {std::pair(&pool->project, Pass::kProject), std::pair(&pool->receive, Pass::kReceive)}) {
    if (*set != VK_NULL_HANDLE) continue;
    LL_ASSIGN_OR_RETURN(*set, sets_->allocate(pass));
  }
  BlockAllocator blocks(bytes, memory_);
  LL_ASSIGN_OR_RETURN(pool->buffer, Buffer::create(context_, bytes, BufferUse::kDevice));
  pool->blocks.emplace(std::move(blocks));

  const VkDescriptorBufferInfo data = pool->buffer.whole();
  const VkDescriptorBufferInfo project[] = {
      data, data, data, data, bindings_.lambda->whole(), bindings_.active_cells->whole(), bindings_.control->whole()};
  sets_->write(pool->project, Pass::kProject, project);
  const VkDescriptorBufferInfo receive[] = {
      bindings_.radiosity->whole(), data, data, data, bindings_.active_cells->whole(), bindings_.control->whole(),
      bindings_.irradiance->whole()};
  sets_->write(pool->receive, Pass::kReceive, receive);
  return absl::OkStatus();
}

void CellPools::release(const Place& place, uint32_t frame) {
  Pool& pool = pools_[place.pool];
  pool.blocks->release(place.offset, place.bytes);
  if (pool.blocks->empty()) pool.retired = frame + context_->frames;
}

void CellPools::free_retired(uint32_t frame) {
  for (Pool& pool : pools_) {
    if (pool.retired == 0 || pool.retired > frame) continue;
    pool.buffer = Buffer();
    pool.retired = 0;
  }
}

RelightPools::RelightPools(Context* context, std::span<const RelightRays> kinds, uint32_t tile_words, uint32_t probes,
                           std::pmr::memory_resource* memory)
    : context_(context), kinds_(kinds.begin(), kinds.end(), memory), probes_(probes), free_(memory) {
  const auto slot_bytes = [&](const RelightRays& r) { return 4 * (uint64_t{r.rays} + tile_words); };
  const uint32_t slots = static_cast<uint32_t>(rounded_up(uint64_t{probes} + probes / 8 + 1, gpu::kSlotGranule));
  const uint64_t fit = context->page_bytes / slot_bytes(kinds[0]) / gpu::kSlotGranule * gpu::kSlotGranule;
  pool_slots_ = static_cast<uint32_t>(
      std::clamp<uint64_t>(fit, gpu::kSlotGranule, rounded_up(std::max(1u, probes / 8), gpu::kSlotGranule)));
  pools_per_kind_ = (slots + pool_slots_ - 1) / pool_slots_;
  if (!check().ok()) return;
  for (uint32_t kind = 0; kind < kinds.size(); ++kind) {
    const uint32_t first = kind * pools_per_kind_ * pool_slots_;
    auto& free = free_.emplace_back();
    free.reserve(slots);
    for (uint32_t s = slots; s > 0; --s) free.push_back(first + s - 1);
    for (uint32_t p = 0; p < pools_per_kind_; ++p) {
      Pool& pool = pools_[kind * pools_per_kind_ + p];
      pool.kind = kind;
      pool.slot_bytes = slot_bytes(kinds[kind]);
      pool.slots = std::min(pool_slots_, slots - p * pool_slots_);
    }
  }
}

absl::Status RelightPools::check() const {
  if (uint64_t{pools_per_kind_} * kinds() <= gpu::kMaxPools) return absl::OkStatus();
  return absl::UnimplementedError("asset has " + std::to_string(probes_) + " probes, pages hold " +
                                  std::to_string(uint64_t{pool_slots_} * gpu::kMaxPools / kinds()) +
                                  "; bake with fewer relight rays or create with larger pages");
}

absl::StatusOr<uint32_t> RelightPools::allocate(uint32_t kind) {
  std::pmr::vector<uint32_t>& free = free_[kind];
  if (free.empty()) return not_ready("what was unloaded is still in use; record frames_in_flight more frames");
  const uint32_t slot = free.back();
  Pool& pool = pools_[slot / pool_slots_];
  if (!pool.buffer.exists()) LL_RETURN_IF_ERROR(create(&pool));
  ++pool.used;
  pool.retired = 0;
  free.pop_back();
  return slot;
}

absl::Status RelightPools::create(Pool* pool) {
  if (pool->mark == VK_NULL_HANDLE) {
    LL_ASSIGN_OR_RETURN(pool->mark, sets_->allocate(Pass::kMark));
  }
  if (pool->relight == VK_NULL_HANDLE) {
    LL_ASSIGN_OR_RETURN(pool->relight, sets_->allocate(Pass::kRelight));
  }
  LL_ASSIGN_OR_RETURN(pool->buffer, Buffer::create(context_, pool->slots * pool->slot_bytes, BufferUse::kDevice));
  const VkDescriptorBufferInfo mark[] = {pool->buffer.whole(), bindings_.slots->whole(), bindings_.changed->whole(),
                                         bindings_.dirty->whole()};
  sets_->write(pool->mark, Pass::kMark, mark);
  const VkDescriptorBufferInfo relight[] = {
      pool->buffer.whole(),      bindings_.radiosity->whole(),    kinds_[pool->kind].sh->whole(),
      bindings_.lambda->whole(), bindings_.active_slots->whole(), bindings_.slots->whole(),
      bindings_.control->whole()};
  sets_->write(pool->relight, Pass::kRelight, relight);
  return absl::OkStatus();
}

void RelightPools::release(uint32_t slot, uint32_t frame) {
  Pool& pool = pools_[slot / pool_slots_];
  free_[pool.kind].push_back(slot);
  if (--pool.used == 0) pool.retired = frame + context_->frames;
}

void RelightPools::free_retired(uint32_t frame) {
  for (Pool& pool : pools_) {
    if (pool.retired == 0 || pool.retired > frame) continue;
    pool.buffer = Buffer();
    pool.retired = 0;
  }
}

}  // namespace lightloom
