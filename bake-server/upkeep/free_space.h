// Whether the state folder's file system has room for more.
#pragma once

#include <atomic>
#include <cstdint>
#include <filesystem>
#include <functional>

#include "core/base/status.h"

namespace lightloom {

/// Bytes that may still be written on the file system of a path.
absl::StatusOr<uint64_t> free_bytes(const std::filesystem::path& path);

/// Thread-safe. Measures with every question, so that what it stopped goes on by itself.
class FreeSpace {
 public:
  using Measure = std::function<absl::StatusOr<uint64_t>(const std::filesystem::path&)>;
  /// `least`: bytes that must stay free; 0: none.
  FreeSpace(std::filesystem::path folder, uint64_t least, Measure measure = free_bytes);

  /// ResourceExhausted, one line, while less is free. Says in the log when that begins and ends. What cannot be measured
  /// counts as enough: writing will show.
  absl::Status check();

 private:
  const std::filesystem::path folder_;
  const uint64_t least_;
  const Measure measure_;
  std::atomic<bool> short_{false};
};

}  // namespace lightloom
