// Ranges of a buffer, first fit.
#pragma once

#include <cstdint>
#include <memory_resource>
#include <optional>
#include <vector>

namespace lightloom {

class BlockAllocator {
 public:
  BlockAllocator(uint64_t bytes, std::pmr::memory_resource* memory) : bytes_(bytes), free_(memory) {
    free_.push_back({0, bytes});
  }

  /// Offset of a range of that size, a multiple of its granule; nothing if there is none. Room for release() to
  /// work without memory is made here.
  std::optional<uint64_t> allocate(uint64_t bytes);
  /// REQUIRES: a range that allocate() returned. Needs no memory.
  void release(uint64_t offset, uint64_t bytes);
  bool empty() const { return blocks_ == 0; }

 private:
  struct Range {
    uint64_t offset, bytes;
  };
  uint64_t bytes_;
  uint64_t blocks_ = 0;
  std::pmr::vector<Range> free_;  ///< by offset; no two touch
};

}  // namespace lightloom
