// Quantities as people type and read them on a command line: sizes and spans of time.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "core/base/status.h"

namespace lightloom {

/// Bytes of "0", "500M", "20G", "1.5T", "32MB": K, M, G and T are powers of 1024. InvalidArgument, one line, for anything else.
absl::StatusOr<uint64_t> parse_size(std::string_view text);

/// Seconds of "90", "90s", "15m", "12h", "30d". InvalidArgument, one line, for anything else.
absl::StatusOr<int64_t> parse_seconds(std::string_view text);

/// "512 B", "1.5 MiB": with the prefixes of parse_size().
std::string size_text(uint64_t bytes);

}  // namespace lightloom
