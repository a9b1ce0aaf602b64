// The clock by which the farm's times are: it never runs backwards, and people can read it.
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>

namespace lightloom {

/// Milliseconds: Unix time when it was made, and steady from then on.
inline std::function<int64_t()> steady_unix_clock() {
  using std::chrono::milliseconds;
  const auto began = std::chrono::steady_clock::now();
  const int64_t unix =
      std::chrono::duration_cast<milliseconds>(std::chrono::system_clock::now().time_since_epoch()).count();
  return
      [=] { return unix + std::chrono::duration_cast<milliseconds>(std::chrono::steady_clock::now() - began).count(); };
}

}  // namespace lightloom
