// Lists of digests as the database keeps them: 32 bytes each, back to back.
#pragma once

#include <cstring>
#include <string>
#include <string_view>
#include <vector>

#include "core/base/hash.h"

namespace lightloom {

inline std::string pack(const std::vector<Digest>& digests) {
  std::string bytes;
  bytes.reserve(digests.size() * sizeof(Digest));
  for (const Digest& digest : digests) bytes.append(digest.bytes.begin(), digest.bytes.end());
  return bytes;
}

inline std::vector<Digest> unpack(std::string_view bytes) {
  std::vector<Digest> digests(bytes.size() / sizeof(Digest));
  for (Digest& digest : digests) {
    std::memcpy(digest.bytes.data(), bytes.data(), sizeof(Digest));
    bytes.remove_prefix(sizeof(Digest));
  }
  return digests;
}

}  // namespace lightloom
