#include "bake-worker/local_executor.h"

#include "bake-worker/patience.h"

namespace lightloom {
namespace {

/// Of the task that the calling thread runs; means nothing between tasks.
thread_local const CancelFlag* cancel_of_task = nullptr;

/// For threads that hold a slot of the gate: others compute while a blob is on its way.
class RemoteBlobs final : public BlobAccess {
 public:
  RemoteBlobs(std::shared_ptr<grpc::Channel> channel, ComputeGate* gate, bool wait_for_room)
      : client_(
            std::move(channel),
            patience_of_tasks([] { return cancel_of_task != nullptr && cancel_of_task->cancelled(); }, wait_for_room)),
        gate_(gate) {}
  absl::StatusOr<std::vector<uint8_t>> get(const Digest& digest) override {
    const ComputeGate::Pause pause(gate_);
    return client_.download(digest);
  }
  absl::Status put(const std::vector<std::vector<uint8_t>>& blobs) override {
    const ComputeGate::Pause pause(gate_);
    return client_.upload(blobs);
  }

 private:
  BlobClient client_;
  ComputeGate* gate_;
};

}  // namespace

LocalExecutor::LocalExecutor(std::shared_ptr<grpc::Channel> channel, uint32_t threads, uint64_t cache_bytes,
                             bool wait_for_room)
    : gate_(threads),
      blobs_(std::make_unique<RemoteBlobs>(std::move(channel), &gate_, wait_for_room)),
      runner_(blobs_.get(), cache_bytes, [this](const std::function<void()>& wait) {
        const ComputeGate::Pause pause(&gate_);
        wait();
      }) {}

absl::StatusOr<TaskOutput> LocalExecutor::run(const BakeTask& task, const BakeControl& control) {
  const ComputeGate::Slot slot(&gate_);
  if (control.cancel != nullptr && control.cancel->cancelled()) return absl::CancelledError("cancelled");
  cancel_of_task = control.cancel;
  auto output = runner_.run(task, control);
  if (!output.ok() && control.cancel != nullptr && control.cancel->cancelled())
    return absl::CancelledError("cancelled");
  return output;
}

}  // namespace lightloom
