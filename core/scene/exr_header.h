// The header of an EXR, looked through before OpenEXR sees it: OpenEXR makes room for an attribute before it reads it, and
// would ask for gigabytes on the word of a few bytes.
#pragma once

#include <cstdint>
#include <span>

#include "core/base/status.h"

namespace lightloom {

/// `head`: the first bytes of the file, at least its header or kMaxExrHeader of them; file_bytes: how many it has. Errors
/// say what is wrong, without the file's name: not an EXR, several parts or deep pixels, an attribute whose size is not
/// that of its type or that ends behind the file, more pixels, or wider lines or tiles, than read_exr takes.
absl::Status check_exr_header(std::span<const uint8_t> head, uint64_t file_bytes);

inline constexpr uint64_t kMaxExrHeader = 1 << 20;

}  // namespace lightloom
