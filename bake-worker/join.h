// How a worker presents itself to its server.
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>

#include "core/base/hash.h"
#include "core/base/status.h"
#include "proto/digest.h"

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
  std::optional<Digest> canary = std::nullopt;
};

/// This program on this machine, with `threads` threads. Its canary is not known yet: bake_canary() takes a moment.
Introduction introduce_this_machine(uint32_t threads);

/// As messages carry it: to a JoinRequest.
template <class JoinRequest>
void to_proto(const Introduction& self, JoinRequest* out) {
  out->set_version(self.version);
  out->set_protocol_version(self.protocol_version);
  out->set_method_version(self.method_version);
  out->set_avx2(self.avx2);
  out->set_threads(self.threads);
  if (self.canary) out->set_canary(to_bytes(*self.canary));
}

/// Joins, waiting at most `deadline` for the server to be there and to answer. Returns the server's release.
/// Errors: FailedPrecondition with the server's reason if it refuses (asking again cannot help); else
/// Unavailable.
absl::StatusOr<std::string> join(const std::shared_ptr<grpc::Channel>& channel, const Introduction& self,
                                 std::chrono::milliseconds deadline);

}  // namespace lightloom
