#include "runtime/vulkan/pools.h"

#include <algorithm>

#include "runtime/boundary.h"

namespace lightloom {
namespace {

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
      return Place{static_cast<uint32_t>(&pool - pools_.data()), *offset, bytes};
    }
  }
  if (unused == nullptr) {
    return absl::UnimplementedError("more than " + std::to_string(gpu::kMaxPools) + " pages of cells are resident; " +
                                    "unload some, or create with larger pages");
  }
  LL_RETURN_IF_ERROR(create(unused, bytes));
  return Place{static_cast<uint32_t>(unused - pools_.data()), *unused->blocks->allocate(bytes), bytes};
}

absl::Status CellPools::create(Pool* pool, uint64_t least) {
  // As large as the rest of the asset needs, a page, and the budget allow.
  uint64_t bytes = total_bytes_ > pool_bytes_ ? total_bytes_ - pool_bytes_ : 0;
  bytes = std::min(bytes, context_->page_bytes);
  if (context_->budget != 0) bytes = std::min(bytes, context_->budget - std::min(context_->budget, context_->bytes));
  bytes = std::max(bytes, least) / gpu::kCellUnit * gpu::kCellUnit;

  for (auto [set, pass] : {std::pair(&pool->project, Pass::kProject), std::pair(&pool->receive, Pass::kReceive),
                           std::pair(&pool->receive_target, Pass::kReceive)}) {
    if (*set != VK_NULL_HANDLE || (set == &pool->receive_target && bindings_.target == nullptr)) continue;
    LL_ASSIGN_OR_RETURN(*set, sets_->allocate(pass));
  }
  BlockAllocator blocks(bytes, memory_);
  LL_ASSIGN_OR_RETURN(pool->buffer, Buffer::create(context_, bytes, BufferUse::kDevice));
  pool->blocks.emplace(std::move(blocks));
  pool_bytes_ += bytes;

  const VkDescriptorBufferInfo data = pool->buffer.whole();
  const VkDescriptorBufferInfo project[] = {
      data, data, data, data, bindings_.lambda->whole(), bindings_.active_cells->whole(), bindings_.control->whole()};
  sets_->write(pool->project, Pass::kProject, project);
  VkDescriptorBufferInfo receive[] = {data,
                                      data,
                                      data,
                                      data,
                                      bindings_.active_cells->whole(),
                                      bindings_.control->whole(),
                                      bindings_.irradiance->whole()};
  sets_->write(pool->receive, Pass::kReceive, receive);
  if (bindings_.target != nullptr) {
    receive[6] = bindings_.target->whole();
    sets_->write(pool->receive_target, Pass::kReceive, receive);
  }
  return absl::OkStatus();
}

void CellPools::release(const Place& place) {
  Pool& pool = pools_[place.pool];
  pool.blocks->release(place.offset, place.bytes);
  if (!pool.blocks->empty()) return;
  pool_bytes_ -= pool.buffer.size();
  pool.buffer = Buffer();
}

RelightPools::RelightPools(Context* context, DescriptorSets* sets, const PoolBindings& bindings, uint64_t slot_bytes,
                           uint32_t probes, std::pmr::memory_resource* memory)
    : context_(context), sets_(sets), bindings_(bindings), slot_bytes_(slot_bytes), slots_(probes), free_(memory) {
  const uint64_t fit = context->page_bytes / slot_bytes / gpu::kSlotGranule * gpu::kSlotGranule;
  pool_slots_ = static_cast<uint32_t>(
      std::clamp<uint64_t>(fit, gpu::kSlotGranule, rounded_up(std::max(1u, probes), gpu::kSlotGranule)));
  free_.reserve(probes);
  for (uint32_t s = probes; s > 0; --s) free_.push_back(s - 1);
}

absl::Status RelightPools::check() const {
  if (slots_ <= uint64_t{pool_slots_} * gpu::kMaxPools) return absl::OkStatus();
  return absl::UnimplementedError("asset has " + std::to_string(slots_) + " probes, pages hold " +
                                  std::to_string(uint64_t{pool_slots_} * gpu::kMaxPools) +
                                  "; bake with fewer relight rays or create with larger pages");
}

absl::StatusOr<uint32_t> RelightPools::allocate() {
  const uint32_t slot = free_.back();  // as many slots as probes
  Pool& pool = pools_[slot / pool_slots_];
  if (!pool.buffer.exists()) {
    pool.slots = std::min(pool_slots_, slots_ - slot / pool_slots_ * pool_slots_);
    LL_RETURN_IF_ERROR(create(&pool));
  }
  ++pool.used;
  free_.pop_back();
  return slot;
}

absl::Status RelightPools::create(Pool* pool) {
  if (pool->mark == VK_NULL_HANDLE) {
    LL_ASSIGN_OR_RETURN(pool->mark, sets_->allocate(Pass::kMark));
  }
  if (pool->relight == VK_NULL_HANDLE) {
    LL_ASSIGN_OR_RETURN(pool->relight, sets_->allocate(Pass::kRelight));
  }
  LL_ASSIGN_OR_RETURN(pool->buffer, Buffer::create(context_, pool->slots * slot_bytes_, BufferUse::kDevice));
  const VkDescriptorBufferInfo mark[] = {pool->buffer.whole(), bindings_.slots->whole(), bindings_.changed->whole(),
                                         bindings_.dirty->whole()};
  sets_->write(pool->mark, Pass::kMark, mark);
  const VkDescriptorBufferInfo relight[] = {
      pool->buffer.whole(),      bindings_.radiosity->whole(),    bindings_.sh->whole(),
      bindings_.lambda->whole(), bindings_.active_slots->whole(), bindings_.slots->whole(),
      bindings_.control->whole()};
  sets_->write(pool->relight, Pass::kRelight, relight);
  return absl::OkStatus();
}

void RelightPools::release(uint32_t slot) {
  Pool& pool = pools_[slot / pool_slots_];
  free_.push_back(slot);
  if (--pool.used == 0) pool.buffer = Buffer();
}

}  // namespace lightloom
