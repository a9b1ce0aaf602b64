// SHA-256 digests: the names of chunks and the identities of meshes, objects and cells.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace lightloom {

struct Digest {
  std::array<uint8_t, 32> bytes{};
  auto operator<=>(const Digest&) const = default;

  std::string hex() const;
  /// The first eight bytes, little-endian: a seed for Rng, never an identity.
  uint64_t low64() const;
};

/// Incremental SHA-256. Values are fed as their little-endian bytes, in a fixed order that the caller documents.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;

  Hasher& bytes(const void* data, size_t size);
  /// Length first, so that ("ab","c") and ("a","bc") differ.
  Hasher& string(std::string_view s);
  template <class T>
  requires(std::is_arithmetic_v<T> || std::is_enum_v<T>) Hasher& value(T v) { return bytes(&v, sizeof v); }
  template <class T>
  Hasher& array(const std::vector<T>& v) {
    static_assert(std::has_unique_object_representations_v<T> || std::is_trivially_copyable_v<T>);
    value(static_cast<uint64_t>(v.size()));
    return bytes(v.data(), v.size() * sizeof(T));
  }
  Hasher& digest(const Digest& d) { return bytes(d.bytes.data(), d.bytes.size()); }
  /// REQUIRES: called once, last.
  Digest finish();

 private:
  void* context_;
};

Digest sha256(std::span<const uint8_t> data);
Digest sha256(std::string_view data);

}  // namespace lightloom
