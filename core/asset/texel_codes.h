// How chunks name texels: by one number, base(object) + key, base being the running sum of 2·w·h over the chunk's objects.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "core/asset/chunk.h"

namespace lightloom {

/// Index of `key` in a surface's keys, which ascend, or keys.size().
inline size_t find_key(std::span<const uint32_t> keys, uint32_t key) {
  const auto it = std::lower_bound(keys.begin(), keys.end(), key);
  return it != keys.end() && *it == key ? static_cast<size_t>(it - keys.begin()) : keys.size();
}

class TexelCodes {
 public:
  explicit TexelCodes(const std::vector<ChunkObject>& objects) {
    for (const ChunkObject& o : objects) base_.push_back(base_.back() + uint64_t{2} * o.width * o.height);
  }

  /// Numbers from here on name none.
  uint64_t count() const { return base_.back(); }
  /// REQUIRES: code < count().
  TexelRef texel(uint32_t code) const {
    const auto slot = std::upper_bound(base_.begin(), base_.end(), code) - base_.begin() - 1;
    return {static_cast<uint32_t>(slot), static_cast<uint32_t>(code - base_[static_cast<size_t>(slot)])};
  }

 private:
  std::vector<uint64_t> base_ = {0};
};

}  // namespace lightloom
