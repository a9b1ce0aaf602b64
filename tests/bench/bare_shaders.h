// The fastest that a shader reads and uses an fp16 matrix on a device, to compare passes with.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "runtime/vulkan/buffer.h"
#include "runtime/vulkan/own_queue.h"

namespace lightloom::bench {

/// Of all threads of this process: lavapipe's shaders run on them.
double process_cpu_seconds();

/// One form of bare_matrix.comp on a matrix of its own.
class BareShader {
 public:
  ~BareShader();
  BareShader(const BareShader&) = delete;
  BareShader& operator=(const BareShader&) = delete;

  std::string name() const;
  /// Of one dispatch; another and another of them are the difference between two submissions.
  double gb_per_cpu_second() const;

 private:
  friend std::vector<std::unique_ptr<BareShader>> bare_shaders(Context*, OwnQueue*, uint32_t, uint64_t);
  BareShader(Context* context, OwnQueue* queue, size_t form, uint32_t group, uint64_t bytes);
  void create_pipeline();
  void create_set();
  double seconds(uint32_t dispatches) const;

  struct Push {
    uint32_t rows, quads;
  };
  Context* context_;
  OwnQueue* queue_;
  size_t form_;
  uint32_t group_;
  uint64_t bytes_;
  Push push_;
  uint32_t groups_;
  Buffer buffers_[3];  // matrix, x, y
  VkDescriptorSetLayout set_layout_ = VK_NULL_HANDLE;
  VkPipelineLayout layout_ = VK_NULL_HANDLE;
  VkPipeline pipeline_ = VK_NULL_HANDLE;
  VkDescriptorPool pool_ = VK_NULL_HANDLE;
  VkDescriptorSet set_ = VK_NULL_HANDLE;
};

/// All forms, in workgroups of 8 and 64, for so many right-hand sides (1, 3), each with a matrix of about `bytes`.
std::vector<std::unique_ptr<BareShader>> bare_shaders(Context* context, OwnQueue* queue, uint32_t columns,
                                                      uint64_t bytes);

}  // namespace lightloom::bench
