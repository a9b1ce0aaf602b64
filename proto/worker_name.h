// What a worker may be called: workers and servers keep the same rule.
#pragma once

#include <algorithm>
#include <string_view>

namespace lightloom {

inline constexpr char kWorkerNameRule[] =
    "a worker's name must have 1 to 64 letters, digits, dots, dashes or underscores";

/// Whether it stands in [A-Za-z0-9._-], whatever the locale.
inline bool fits_worker_name(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '.' || c == '_' || c == '-';
}

/// Whether kWorkerNameRule holds.
inline bool is_worker_name(std::string_view name) {
  return !name.empty() && name.size() <= 64 && std::all_of(name.begin(), name.end(), fits_worker_name);
}

}  // namespace lightloom
