#include "runtime/host_memory.h"

#include <new>

namespace lightloom {

void* HostMemory::do_allocate(size_t bytes, size_t alignment) {
  if (allocator_.allocate == nullptr) return ::operator new(bytes, std::align_val_t(alignment));
  void* memory = allocator_.allocate(allocator_.user, bytes, alignment);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

void HostMemory::do_deallocate(void* memory, size_t bytes, size_t alignment) {
  if (allocator_.allocate == nullptr) {
    ::operator delete(memory, std::align_val_t(alignment));
  } else {
    allocator_.release(allocator_.user, memory, bytes, alignment);
  }
}

}  // namespace lightloom
