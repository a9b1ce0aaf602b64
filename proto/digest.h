// Digests as messages carry them: 32 bytes.
#pragma once

#include <algorithm>
#include <string>

#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

inline std::string to_bytes(const Digest& digest) { return {digest.bytes.begin(), digest.bytes.end()}; }

inline absl::StatusOr<Digest> to_digest(const std::string& bytes) {
  Digest out;
  if (bytes.size() != out.bytes.size()) return absl::InvalidArgumentError("a digest must have 32 bytes");
  std::copy(bytes.begin(), bytes.end(), out.bytes.begin());
  return out;
}

}  // namespace lightloom
