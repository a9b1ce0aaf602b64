// The queue of a device of our own: commands that are submitted and waited for.
#pragma once

#include <memory>

#include "runtime/vulkan/context.h"

namespace lightloom {

class OwnQueue {
 public:
  static absl::StatusOr<std::unique_ptr<OwnQueue>> create(Context* context, VkQueue queue, uint32_t family);
  ~OwnQueue();
  OwnQueue(const OwnQueue&) = delete;
  OwnQueue& operator=(const OwnQueue&) = delete;

  /// Records what `body`, which takes the command buffer and returns an absl::Status, records; submits it and waits.
  template <class Body>
  absl::Status run(Body body) {
    LL_RETURN_IF_ERROR(begin());
    LL_RETURN_IF_ERROR(body(commands_));
    return submit_and_wait();
  }

 private:
  OwnQueue(Context* context, VkQueue queue) : context_(context), queue_(queue) {}
  absl::Status begin();
  absl::Status submit_and_wait();

  Context* context_;
  VkQueue queue_;
  VkCommandPool pool_ = VK_NULL_HANDLE;
  VkCommandBuffer commands_ = VK_NULL_HANDLE;
  VkFence fence_ = VK_NULL_HANDLE;
};

}  // namespace lightloom
