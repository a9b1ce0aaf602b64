// Which probes or cells wait for their update, and whose turn it is.
#pragma once

#include <algorithm>
#include <cstdint>

#include "runtime/simd/array.h"

namespace lightloom::simd {

/// A set of numbers below `size`, taken a few at a time, round-robin, so that none starves.
class Turns {
 public:
  Turns() = default;
  Turns(std::pmr::memory_resource* memory, uint32_t size) : waits_(memory, size), taken_(memory, size) {}

  void add(uint32_t i) {
    waiting_ += waits_[i] == 0;
    waits_[i] = 1;
  }
  void remove(uint32_t i) {
    waiting_ -= waits_[i] != 0;
    waits_[i] = 0;
  }
  bool contains(uint32_t i) const { return waits_[i] != 0; }
  uint32_t waiting() const { return waiting_; }

  /// Removes and returns at most `most` (0: all), beginning after the last one returned. Valid until the next call.
  std::span<const uint32_t> take(uint32_t most) {
    const uint32_t size = static_cast<uint32_t>(waits_.size());
    const uint32_t count = most == 0 ? waiting_ : std::min(most, waiting_);
    uint32_t n = 0;
    while (n < count) {
      if (waits_[next_] != 0) {
        waits_[next_] = 0;
        taken_[n++] = next_;
      }
      next_ = next_ + 1 == size ? 0 : next_ + 1;
    }
    waiting_ -= count;
    return {taken_.data(), count};
  }

 private:
  Array<uint8_t> waits_;
  Array<uint32_t> taken_;
  uint32_t waiting_ = 0, next_ = 0;
};

}  // namespace lightloom::simd
