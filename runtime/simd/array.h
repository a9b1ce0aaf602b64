// Memory whose size is fixed once, aligned to cache lines, from the caller's memory resource.
#pragma once

#include <cstring>
#include <memory_resource>
#include <span>
#include <type_traits>
#include <utility>

namespace lightloom::simd {

inline constexpr size_t kArrayAlignment = 64;

/// `size` zeroed T. Throws what the resource throws.
template <class T>
class Array {
  static_assert(std::is_trivially_copyable_v<T> && std::is_trivially_destructible_v<T>);

 public:
  Array() = default;
  Array(std::pmr::memory_resource* memory, size_t size) : memory_(memory), size_(size) {
    if (size == 0) return;
    data_ = static_cast<T*>(memory->allocate(size * sizeof(T), kArrayAlignment));
    std::memset(static_cast<void*>(data_), 0, size * sizeof(T));
  }
  Array(Array&& from) noexcept { swap(from); }
  Array& operator=(Array&& from) noexcept {
    Array(std::move(from)).swap(*this);
    return *this;
  }
  ~Array() {
    if (data_ != nullptr) memory_->deallocate(data_, size_ * sizeof(T), kArrayAlignment);
  }

  T* data() { return data_; }
  const T* data() const { return data_; }
  size_t size() const { return size_; }
  size_t bytes() const { return size_ * sizeof(T); }
  T& operator[](size_t i) { return data_[i]; }
  const T& operator[](size_t i) const { return data_[i]; }
  T* begin() { return data_; }
  T* end() { return data_ + size_; }
  const T* begin() const { return data_; }
  const T* end() const { return data_ + size_; }
  void fill(T value) {
    for (T& v : *this) v = value;
  }

 private:
  void swap(Array& other) noexcept {
    std::swap(memory_, other.memory_);
    std::swap(data_, other.data_);
    std::swap(size_, other.size_);
  }

  std::pmr::memory_resource* memory_ = nullptr;
  T* data_ = nullptr;
  size_t size_ = 0;
};

}  // namespace lightloom::simd
