// Whole messages over a stream socket: each behind its length, 32 bits little-endian.
#pragma once

#include <mutex>
#include <optional>
#include <string>
#include <string_view>

#include "core/base/status.h"

namespace lightloom {

/// Any thread may write; one thread reads.
class Frames {
 public:
  /// Owns the descriptor from now on.
  explicit Frames(int descriptor) : descriptor_(descriptor) {}
  ~Frames();
  Frames(const Frames&) = delete;
  Frames& operator=(const Frames&) = delete;

  /// Unavailable: the other end is closed.
  absl::Status write(std::string_view message);
  /// Waits for the next message; nothing once the other end is closed, even in the middle of one. DataLoss: a length beyond
  /// reason.
  absl::StatusOr<std::optional<std::string>> read();

 private:
  absl::Status send_all(const char* data, size_t size);
  /// False at the end.
  bool receive_all(char* data, size_t size);

  const int descriptor_;
  std::mutex writing_;
};

}  // namespace lightloom
