// How a worker presents itself to its server.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>

#include "core/base/status.h"

namespace grpc {
class Channel;
}

namespace lightloom {

/// What a worker says of itself when it joins (proto/worker_service.proto says what each means).
struct Introduction {
  std::string version;
  uint32_t protocol_version = 0;
  std::string method_version;
  bool avx2 = false;
  uint32_t threads = 0;
};

/// This program on this machine, with `threads` threads.
Introduction introduce_this_machine(uint32_t threads);

/// Joins, waiting at most `deadline` for the server to be there and to answer. Returns the server's release.
/// Errors: FailedPrecondition with the server's reason if it refuses (asking again cannot help); else
/// Unavailable.
absl::StatusOr<std::string> join(const std::shared_ptr<grpc::Channel>& channel, const Introduction& self,
                                 std::chrono::milliseconds deadline);

}  // namespace lightloom
