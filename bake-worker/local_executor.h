// Tasks in this process, blobs on the server.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "bake-worker/compute_gate.h"
#include "bake-worker/executor.h"

namespace grpc {
class Channel;
}

namespace lightloom {

class LocalExecutor final : public TaskExecutor {
 public:
  /// So many tasks compute at once; others may wait for blobs meanwhile. Keeps levels warm within `cache_bytes`.
  /// `wait_for_room`: also a server whose disk is full is waited for.
  LocalExecutor(std::shared_ptr<grpc::Channel> channel, uint32_t threads, uint64_t cache_bytes,
                bool wait_for_room = true);

  /// See TaskRunner::adopt.
  void adopt(std::span<const uint8_t> payload, std::shared_ptr<const BakeSession> session) {
    runner_.adopt(payload, std::move(session));
  }
  absl::StatusOr<TaskOutput> run(const BakeTask& task, const BakeControl& control) override;

 private:
  ComputeGate gate_;
  std::unique_ptr<BlobAccess> blobs_;
  TaskRunner runner_;
};

}  // namespace lightloom
