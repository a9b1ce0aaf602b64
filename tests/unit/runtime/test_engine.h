// What an engine has, for tests and benchmarks: a device with a queue, and a runtime on it that records into the queue's
// command buffer.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <functional>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "core/base/half.h"
#include "runtime/include/lightloom_vulkan.h"
#include "runtime/vulkan/barriers.h"
#include "runtime/vulkan/buffer.h"
#include "runtime/vulkan/own_queue.h"
#include "tests/unit/runtime/test_runtime.h"

namespace lightloom::testing {

/// Destroys its runtime and then demands that validation said nothing.
class Engine {
 public:
  /// Changes what the runtime is created from.
  using Adjust = std::function<void(const lightloom_vulkan_device&, lightloom_vulkan_create_info*)>;

  explicit Engine(VkFormat format = VK_FORMAT_UNDEFINED, uint32_t device_flags = LIGHTLOOM_CREATE_VALIDATION,
                  const Adjust& adjust = {}) {
    lightloom_vulkan_device_info info{};
    info.struct_size = sizeof info;
    info.flags = device_flags;
    info.message = Received::add;
    info.message_user = &received_;
    EXPECT_EQ(lightloom_vulkan_make_device(&info, &device_), LIGHTLOOM_OK) << joined(received_.errors);
    EXPECT_TRUE(context_.vk.load_instance(device_.instance, device_.get_instance_proc_addr).ok());
    EXPECT_TRUE(context_.vk.load_device(device_.device, nullptr).ok());
    context_.device = device_.device;
    VkPhysicalDeviceProperties properties;
    context_.vk.GetPhysicalDeviceProperties(device_.physical_device, &properties);
    name_ = properties.deviceName;
    context_.limits = properties.limits;
    context_.vk.GetPhysicalDeviceMemoryProperties(device_.physical_device, &context_.memory);
    queue_ = *OwnQueue::create(&context_, device_.queue, device_.queue_family);

    lightloom_vulkan_create_info create{};
    create.struct_size = sizeof create;
    create.message = Received::add;
    create.message_user = &received_;
    create.instance = device_.instance;
    create.physical_device = device_.physical_device;
    create.device = device_.device;
    create.get_instance_proc_addr = device_.get_instance_proc_addr;
    create.queue_family = device_.queue_family;
    create.frames_in_flight = 2;
    create.image_format = format;
    if (adjust) adjust(device_, &create);
    EXPECT_EQ(lightloom_vulkan_create(&create, &runtime_), LIGHTLOOM_OK) << joined(received_.errors);
  }
  ~Engine() {
    lightloom_destroy(runtime_);
    queue_ = nullptr;
    lightloom_vulkan_destroy_device(&device_);
    EXPECT_TRUE(received_.validation.empty()) << joined(received_.validation);
  }
  Engine(const Engine&) = delete;
  Engine& operator=(const Engine&) = delete;

  lightloom_runtime* runtime() const { return runtime_; }
  Context& context() { return context_; }
  OwnQueue& queue() { return *queue_; }
  VkInstance instance() const { return device_.instance; }
  VkPhysicalDevice physical_device() const { return device_.physical_device; }
  PFN_vkGetInstanceProcAddr instance_proc() const { return device_.get_instance_proc_addr; }
  const std::string& device_name() const { return name_; }

  /// `asset` has SyntheticAsset's read_chunk.
  template <class Asset>
  void load(Asset& asset, const std::vector<uint8_t>& manifest) {
    lightloom_asset_info info{};
    info.struct_size = sizeof info;
    info.manifest = manifest.data();
    info.manifest_bytes = manifest.size();
    info.read_chunk = Asset::read_chunk;
    info.read_user = &asset;
    ASSERT_EQ(lightloom_load(runtime_, &info), LIGHTLOOM_OK) << joined(received_.errors);
  }
  void load(SyntheticAsset& asset) { load(asset, encode_manifest(asset.manifest)); }
  void light(const SurfaceLight& l) {
    ASSERT_EQ(lightloom_set_direct(runtime_, &l.direct[0].x, 0, l.direct.size()), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_set_albedo(runtime_, &l.albedo[0].x, 0, l.albedo.size()), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_set_emission(runtime_, &l.emission[0].x, 0, l.emission.size()), LIGHTLOOM_OK);
    ASSERT_EQ(lightloom_set_environment(runtime_, &l.environment.x), LIGHTLOOM_OK);
  }
  /// Submits `body`'s commands and waits.
  template <class Body>
  void run(Body body) {
    const absl::Status status = queue_->run([&](VkCommandBuffer commands) -> absl::Status {
      body(commands);
      return absl::OkStatus();
    });
    ASSERT_TRUE(status.ok()) << status;
  }
  void frame(const lightloom_frame_info* info = nullptr) {
    run([&](VkCommandBuffer commands) {
      EXPECT_EQ(lightloom_vulkan_record(runtime_, commands, info), LIGHTLOOM_OK) << joined(received_.errors);
    });
  }
  lightloom_vulkan_outputs outputs() const {
    lightloom_vulkan_outputs out{};
    out.struct_size = sizeof out;
    EXPECT_EQ(lightloom_vulkan_get_outputs(runtime_, &out), LIGHTLOOM_OK);
    return out;
  }
  /// Of the frames that the runtime knows to be finished: the last one but `frames_in_flight` - 1.
  lightloom_stats stats() const {
    lightloom_stats s{};
    s.struct_size = sizeof s;
    EXPECT_EQ(lightloom_get_stats(runtime_, &s), LIGHTLOOM_OK);
    return s;
  }
  lightloom_counts counts() const {
    lightloom_counts c{};
    c.struct_size = sizeof c;
    EXPECT_EQ(lightloom_get_counts(runtime_, &c), LIGHTLOOM_OK);
    return c;
  }
  /// The floats that `copy` records into a host buffer of `count`. No barrier: what we recorded is visible already.
  template <class Copy>
  std::vector<float> read(size_t count, Copy copy) {
    const Buffer host = *Buffer::create(&context_, count * sizeof(float), BufferUse::kHost);
    run([&](VkCommandBuffer commands) {
      copy(commands, host.handle());
      barrier_after(context_, commands);
    });
    std::vector<float> out(count);
    std::memcpy(out.data(), host.mapped(), count * sizeof(float));
    return out;
  }
  std::vector<Vec3> read_vec3(VkBuffer buffer) {
    const uint32_t S = outputs().surface_elements;
    const std::vector<float> values = read(3 * S, [&](VkCommandBuffer commands, VkBuffer to) {
      const VkBufferCopy copy{0, 0, 12ull * S};
      context_.vk.CmdCopyBuffer(commands, buffer, to, 1, &copy);
    });
    std::vector<Vec3> out(S);
    for (uint32_t s = 0; s < S; ++s) out[s] = {values[3 * s], values[3 * s + 1], values[3 * s + 2]};
    return out;
  }
  /// E as the image has it: R, G, B, A of each texel, layer by layer.
  std::vector<float> read_image() {
    const lightloom_vulkan_outputs out = outputs();
    const auto copy_image = function<PFN_vkCmdCopyImageToBuffer>("vkCmdCopyImageToBuffer");
    const size_t values = size_t{4} * out.image_width * out.image_height * out.image_layers;
    const bool halfs = out.image_format == VK_FORMAT_R16G16B16A16_SFLOAT;
    std::vector<float> image = read(halfs ? values / 2 : values, [&](VkCommandBuffer commands, VkBuffer to) {
      VkBufferImageCopy region{};
      region.imageSubresource = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 0, out.image_layers};
      region.imageExtent = {out.image_width, out.image_height, 1};
      auto barrier = vulkan_struct<VkImageMemoryBarrier>(VK_STRUCTURE_TYPE_IMAGE_MEMORY_BARRIER);
      barrier.dstAccessMask = VK_ACCESS_TRANSFER_READ_BIT;
      barrier.oldLayout = VK_IMAGE_LAYOUT_GENERAL;
      barrier.newLayout = VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL;
      barrier.image = out.image;
      barrier.subresourceRange = {VK_IMAGE_ASPECT_COLOR_BIT, 0, 1, 0, out.image_layers};
      context_.vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, VK_PIPELINE_STAGE_TRANSFER_BIT, 0, 0,
                                     nullptr, 0, nullptr, 1, &barrier);
      copy_image(commands, out.image, VK_IMAGE_LAYOUT_TRANSFER_SRC_OPTIMAL, to, 1, &region);
      // As it was: the next frame writes it in that layout.
      barrier.dstAccessMask = 0;
      std::swap(barrier.oldLayout, barrier.newLayout);
      context_.vk.CmdPipelineBarrier(commands, VK_PIPELINE_STAGE_TRANSFER_BIT, VK_PIPELINE_STAGE_ALL_COMMANDS_BIT, 0, 0,
                                     nullptr, 0, nullptr, 1, &barrier);
    });
    if (!halfs) return image;
    std::vector<Half> packed(values);
    std::memcpy(packed.data(), image.data(), values * sizeof(Half));
    image.assign(values, 0);
    std::transform(packed.begin(), packed.end(), image.begin(), half_to_float);
    return image;
  }
  template <class F>
  F function(const char* name) const {
    return reinterpret_cast<F>(device_.get_instance_proc_addr(device_.instance, name));
  }

 private:
  Received received_;
  lightloom_vulkan_device device_{};
  std::string name_;
  Context context_;
  std::unique_ptr<OwnQueue> queue_;
  lightloom_runtime* runtime_ = nullptr;
};

}  // namespace lightloom::testing
