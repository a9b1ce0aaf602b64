// Small translations between messages and the server's own types. For .cpp files of this folder only.
#pragma once

#include <grpcpp/grpcpp.h>

#include <mutex>
#include <string>

#include "core/base/status.h"
#include "proto/digest.h"

namespace lightloom {

inline grpc::Status to_grpc(const absl::Status& status) {
  return {static_cast<grpc::StatusCode>(status.code()), std::string(status.message())};
}

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
