// The caller's allocator as a memory resource.
#pragma once

#include <memory_resource>

#include "runtime/include/lightloom.h"

namespace lightloom {

class HostMemory final : public std::pmr::memory_resource {
 public:
  /// REQUIRES: both functions or neither.
  explicit HostMemory(const lightloom_allocator& allocator) : allocator_(allocator) {}

 private:
  /// Throws std::bad_alloc, which the C boundary turns into OUT_OF_MEMORY.
  void* do_allocate(size_t bytes, size_t alignment) override;
  void do_deallocate(void* memory, size_t bytes, size_t alignment) override;
  bool do_is_equal(const memory_resource& other) const noexcept override { return this == &other; }

  lightloom_allocator allocator_;
};

}  // namespace lightloom
