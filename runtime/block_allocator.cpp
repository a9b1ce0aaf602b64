#include "runtime/block_allocator.h"

#include <algorithm>

namespace lightloom {

std::optional<uint64_t> BlockAllocator::allocate(uint64_t bytes) {
  const auto it = std::find_if(free_.begin(), free_.end(), [bytes](const Range& r) { return r.bytes >= bytes; });
  if (it == free_.end()) return std::nullopt;
  const size_t index = static_cast<size_t>(it - free_.begin());
  // n blocks leave at most n + 1 gaps.
  free_.reserve(blocks_ + 3);
  Range& range = free_[index];
  const uint64_t offset = range.offset;
  range.offset += bytes;
  range.bytes -= bytes;
  if (range.bytes == 0) free_.erase(free_.begin() + static_cast<int64_t>(index));
  ++blocks_;
  return offset;
}

void BlockAllocator::release(uint64_t offset, uint64_t bytes) {
  auto after = std::find_if(free_.begin(), free_.end(), [offset](const Range& r) { return r.offset > offset; });
  const bool joins_after = after != free_.end() && offset + bytes == after->offset;
  const bool joins_before = after != free_.begin() && std::prev(after)->offset + std::prev(after)->bytes == offset;
  if (joins_before && joins_after) {
    std::prev(after)->bytes += bytes + after->bytes;
    free_.erase(after);
  } else if (joins_before) {
    std::prev(after)->bytes += bytes;
  } else if (joins_after) {
    after->offset = offset;
    after->bytes += bytes;
  } else {
    free_.insert(after, {offset, bytes});
  }
  --blocks_;
}

}  // namespace lightloom
