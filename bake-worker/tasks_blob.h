// Tasks that a task asks for, as a blob: a hundred thousand of them are no message.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "core/bake/task_runner.h"
#include "core/base/parallel.h"

namespace grpc {
class Channel;
}

namespace lightloom {

/// Uploads them (proto/worker_service.proto, TaskList) and returns the blob's name; none if they are few enough for a
/// message. A server that is away or (`wait_for_room`) full is waited for ten minutes, or until `cancel`.
absl::StatusOr<std::optional<Digest>> upload_if_long(const std::shared_ptr<grpc::Channel>& channel,
                                                     const std::vector<SpawnedTask>& tasks, const CancelFlag& cancel,
                                                     bool wait_for_room);

}  // namespace lightloom
