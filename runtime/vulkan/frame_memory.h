// What each frame in flight has of its own: staging, lights, read-back counters, time stamps.
#pragma once

#include <array>
#include <memory>

#include "runtime/shaders/layout.h"
#include "runtime/vulkan/upload.h"

namespace lightloom {

/// Time stamps of a frame, taken at the end of each step.
enum class Step { kStart, kUpload, kDirect, kRadiosity, kSelect, kRelight, kSelectCells, kProject, kReceive, kImage };
inline constexpr uint32_t kSteps = 10;
/// Milliseconds from the step before.
using StepTimes = std::array<double, kSteps>;

class FrameMemory {
 public:
  static absl::StatusOr<std::unique_ptr<FrameMemory>> create(Context* context, uint64_t staging_bytes,
                                                             uint32_t max_lights, uint32_t max_views);
  ~FrameMemory();
  FrameMemory(const FrameMemory&) = delete;
  FrameMemory& operator=(const FrameMemory&) = delete;

  uint32_t max_lights() const { return max_lights_; }
  uint32_t max_views() const { return max_views_; }

  /// Whether frame `frame` recorded anything whose results can be taken; forgets it. REQUIRES: it is finished.
  absl::StatusOr<bool> take(uint32_t frame, gpu::Control* counters, StepTimes* times);

  Staging staging(uint32_t frame) const;
  gpu::Light* lights(uint32_t frame) const { return at<gpu::Light>(frame, lights_at_); }
  gpu::ShadowView* views(uint32_t frame) const { return at<gpu::ShadowView>(frame, views_at_); }
  VkDescriptorBufferInfo lights_range(uint32_t frame) const;
  VkDescriptorBufferInfo views_range(uint32_t frame) const;
  absl::Status flush_lights(uint32_t frame) const;

  /// Records the copy of the counters, and that the frame has some.
  void read_back(VkCommandBuffer commands, uint32_t frame, const Buffer& control);
  void begin_times(VkCommandBuffer commands, uint32_t frame);
  void time(VkCommandBuffer commands, uint32_t frame, Step step) const;

  /// Results of earlier frames are not wanted any more.
  void forget() { recorded_.fill(0); }

  /// All of it as one buffer that the host reads: REQUIRES that no frame is in flight.
  const Buffer& buffer() const { return buffer_; }

 private:
  FrameMemory(Context* context, uint32_t max_lights, uint32_t max_views)
      : context_(context), max_lights_(max_lights), max_views_(max_views) {}
  uint64_t start(uint32_t frame) const { return frame % context_->frames * frame_bytes_; }
  template <class T>
  T* at(uint32_t frame, uint64_t offset) const {
    return reinterpret_cast<T*>(buffer_.mapped() + start(frame) + offset);
  }

  Context* context_;
  uint32_t max_lights_, max_views_;
  uint64_t staging_bytes_ = 0, lights_at_ = 0, views_at_ = 0, control_at_ = 0, frame_bytes_ = 0;
  Buffer buffer_;
  VkQueryPool queries_ = VK_NULL_HANDLE;
  std::array<uint32_t, 8> recorded_{};  ///< per frame in flight: the frame that has results, or 0
};

}  // namespace lightloom
