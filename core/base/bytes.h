// Little-endian byte streams for stored structures. The reader trusts nothing.
#pragma once

#include <algorithm>
#include <bit>
#include <cstdint>
#include <cstring>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

#include "core/base/status.h"

namespace lightloom {

static_assert(std::endian::native == std::endian::little, "stored structures are written as they lie in memory");

class ByteWriter {
 public:
  template <class T>
  requires std::is_trivially_copyable_v<T>
  void value(const T& v) { raw(&v, sizeof v); }
  /// Elements only; the count is written by the caller, in the header. Padded to 16 bytes before.
  template <class T>
  requires std::is_trivially_copyable_v<T>
  void array(const std::vector<T>& v) {
    align();
    raw(v.data(), v.size() * sizeof(T));
  }
  void raw(const void* data, size_t size) {
    if (size == 0) return;
    const size_t at = bytes_.size();
    bytes_.resize(at + size);
    std::memcpy(bytes_.data() + at, data, size);
  }
  void align() { bytes_.resize((bytes_.size() + 15) / 16 * 16); }
  size_t size() const { return bytes_.size(); }
  std::vector<uint8_t> take() && { return std::move(bytes_); }

 private:
  std::vector<uint8_t> bytes_;
};

/// Reads what ByteWriter wrote. After the first failure every further read fails, values are 0 and arrays empty, so a
/// decoder reads a whole block and asks ok() once.
class ByteReader {
 public:
  explicit ByteReader(std::span<const uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  requires std::is_trivially_copyable_v<T> T value() {
    T v{};
    if (take(sizeof v)) std::memcpy(&v, bytes_.data() + at_ - sizeof v, sizeof v);
    return v;
  }
  /// Fails without allocating if fewer than `count` elements are left.
  template <class T>
  requires std::is_trivially_copyable_v<T> std::vector<T> array(uint64_t count) {
    align();
    std::vector<T> v;
    if (count > (bytes_.size() - at_) / sizeof(T)) {
      ok_ = false;
    } else if (ok_ && count > 0) {
      v.resize(count);
      std::memcpy(v.data(), bytes_.data() + at_, count * sizeof(T));
      at_ += count * sizeof(T);
    }
    return v;
  }
  void align() {
    const size_t padded = (at_ + 15) / 16 * 16;
    for (; at_ < padded; ++at_) {
      if (at_ >= bytes_.size() || bytes_[at_] != 0) {
        ok_ = false;
        at_ = std::min(at_, bytes_.size());
        return;
      }
    }
  }
  bool ok() const { return ok_; }
  /// Everything was read, nothing is left over.
  bool at_end() const { return ok_ && at_ == bytes_.size(); }

 private:
  bool take(size_t size) {
    if (!ok_ || size > bytes_.size() - at_) return ok_ = false;
    at_ += size;
    return true;
  }

  std::span<const uint8_t> bytes_;
  size_t at_ = 0;
  bool ok_ = true;
};

}  // namespace lightloom
