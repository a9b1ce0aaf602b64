// One at a time tidies a state folder, or copies it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <utility>

#include "core/base/status.h"

namespace lightloom {

/// STATE/upkeep.lock, held until the end of this object's life, or of the process, however it ends.
class UpkeepLock {
 public:
  /// Unavailable if another has it: a gc, a backup, or the server's own upkeep.
  static absl::StatusOr<UpkeepLock> take(const std::filesystem::path& state);
  /// Waits for whoever has it.
  static absl::StatusOr<UpkeepLock> wait(const std::filesystem::path& state);
  ~UpkeepLock();
  UpkeepLock(UpkeepLock&& other) noexcept : fd_(std::exchange(other.fd_, -1)) {}
  UpkeepLock& operator=(UpkeepLock&& other) noexcept {
    std::swap(fd_, other.fd_);
    return *this;
  }

  /// Unix time in nanoseconds by the clock that stamps files there.
  absl::StatusOr<int64_t> now_ns() const;

 private:
  explicit UpkeepLock(int fd) : fd_(fd) {}
  static absl::StatusOr<UpkeepLock> take(const std::filesystem::path& state, int operation);

  int fd_;
};

}  // namespace lightloom
