// Small translations between messages and the server's own types. For .cpp files of this folder only.
#pragma once

#include <grpcpp/grpcpp.h>

#include <algorithm>
#include <mutex>
#include <string>

#include "core/base/hash.h"
#include "core/base/status.h"

namespace lightloom {

inline grpc::Status to_grpc(const absl::Status& status) {
  return {static_cast<grpc::StatusCode>(status.code()), std::string(status.message())};
}

inline absl::StatusOr<Digest> to_digest(const std::string& bytes) {
  Digest out;
  if (bytes.size() != out.bytes.size()) return absl::InvalidArgumentError("a digest must have 32 bytes");
  std::copy(bytes.begin(), bytes.end(), out.bytes.begin());
  return out;
}

inline std::string to_bytes(const Digest& digest) { return {digest.bytes.begin(), digest.bytes.end()}; }

/// gRPC hands a reactor from thread to thread under locks of its own, which a race detector cannot see. Every method of a
/// reactor holds this one, so that it can.
class HandOver {
 public:
  [[nodiscard]] std::unique_lock<std::mutex> hold() { return std::unique_lock(mutex_); }

 private:
  std::mutex mutex_;
};

inline grpc::ServerUnaryReactor* finish(grpc::CallbackServerContext* context, const absl::Status& status) {
  grpc::ServerUnaryReactor* reactor = context->DefaultReactor();
  reactor->Finish(to_grpc(status));
  return reactor;
}

}  // namespace lightloom
