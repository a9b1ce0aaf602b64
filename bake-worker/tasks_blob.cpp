#include "bake-worker/tasks_blob.h"

#include <span>
#include <string>

#include "bake-worker/patience.h"
#include "bake-worker/task_messages.h"
#include "proto/worker_service.pb.h"

namespace lightloom {
namespace {

/// About a thousand tasks. A Sync, of 2 MiB at most, may report dozens of such.
constexpr size_t kMostInMessage = size_t{64} << 10;

}  // namespace

absl::StatusOr<std::optional<Digest>> upload_if_long(const std::shared_ptr<grpc::Channel>& channel,
                                                     const std::vector<SpawnedTask>& tasks, const CancelFlag& cancel,
                                                     bool wait_for_room) {
  v1::TaskList list;
  add_tasks(tasks, &list);
  if (list.ByteSizeLong() <= kMostInMessage) return std::nullopt;
  const std::string bytes = list.SerializeAsString();
  const BlobClient blobs(channel, patience_of_tasks([&cancel] { return cancel.cancelled(); }, wait_for_room));
  LL_ASSIGN_OR_RETURN(const Digest digest,
                      blobs.upload(std::span(reinterpret_cast<const uint8_t*>(bytes.data()), bytes.size())));
  return digest;
}

}  // namespace lightloom
