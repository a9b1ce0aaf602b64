#include "runtime/runtime.h"

#include <algorithm>
#include <string>
#include <utility>

#include "runtime/vulkan/status.h"

namespace lightloom {
namespace {

constexpr uint64_t kDefaultPageBytes = 64ull << 20;
/// Frames that one submission holds.
constexpr uint32_t kFramesPerSubmit = 8;
constexpr uint32_t kQueriesPerFrame = kPasses + 1;

}  // namespace

absl::StatusOr<std::unique_ptr<Runtime>> Runtime::create(const RuntimeOptions& options) {
  std::unique_ptr<Runtime> runtime(new Runtime);
  runtime->messages_ = options.messages;
  LL_ASSIGN_OR_RETURN(runtime->device_, Device::create(options.validation, options.messages));
  const VkPhysicalDeviceLimits& device = runtime->device_->limits();
  GpuLimits& limits = runtime->limits_;
  limits.page_bytes = std::min<uint64_t>(options.page_bytes == 0 ? kDefaultPageBytes : options.page_bytes,
                                         device.maxStorageBufferRange);
  limits.max_groups = std::min(device.maxComputeWorkGroupCount[0], device.maxComputeWorkGroupCount[1]);
  if (options.max_groups != 0) limits.max_groups = std::min(limits.max_groups, options.max_groups);
  limits.force_staging = options.force_staging;

  if (runtime->device_->timestamp_bits() > 0) {
    auto info = vulkan_struct<VkQueryPoolCreateInfo>(VK_STRUCTURE_TYPE_QUERY_POOL_CREATE_INFO);
    info.queryType = VK_QUERY_TYPE_TIMESTAMP;
    info.queryCount = kFramesPerSubmit * kQueriesPerFrame;
    LL_VK_RETURN_IF_ERROR("vkCreateQueryPool",
                          vkCreateQueryPool(runtime->device_->handle(), &info, nullptr, &runtime->queries_));
  }
  LL_ASSIGN_OR_RETURN(runtime->transfer_, Transfer::create(runtime->device_.get()));
  LL_ASSIGN_OR_RETURN(runtime->pipelines_, Pipelines::create(runtime->device_.get()));
  return runtime;
}

Runtime::~Runtime() {
  if (queries_ != VK_NULL_HANDLE) vkDestroyQueryPool(device_->handle(), queries_, nullptr);
}

absl::Status Runtime::load(std::span<const uint8_t> manifest, ReadChunk read) {
  // The old asset goes first: both may not fit.
  unload();
  stats_ = {};
  LL_ASSIGN_OR_RETURN(const AssetSource source, AssetSource::open(manifest, std::move(read)));
  LL_ASSIGN_OR_RETURN(asset_, GpuAsset::load(device_.get(), transfer_.get(), pipelines_.get(), source, limits_));
  return absl::OkStatus();
}

absl::Status Runtime::set(SurfaceArray array, std::span<const float> rgb) {
  return transfer_->upload(asset_->array(array), {reinterpret_cast<const uint8_t*>(rgb.data()), rgb.size_bytes()});
}

absl::Status Runtime::update(uint32_t iterations) {
  Stats stats;
  stats.timestamps = queries_ != VK_NULL_HANDLE;
  for (uint32_t done = 0; done < iterations;) {
    const uint32_t frames = std::min(kFramesPerSubmit, iterations - done);
    LL_RETURN_IF_ERROR(device_->run([&](VkCommandBuffer commands) {
      if (queries_ != VK_NULL_HANDLE) vkCmdResetQueryPool(commands, queries_, 0, frames * kQueriesPerFrame);
      for (uint32_t f = 0; f < frames; ++f) asset_->record_frame(commands, queries_, f * kQueriesPerFrame);
      barrier_to_all(commands);
    }));
    LL_RETURN_IF_ERROR(add_times(frames, &stats));
    done += frames;
  }
  stats.frames = iterations;
  stats_ = stats;
  return absl::OkStatus();
}

absl::Status Runtime::add_times(uint32_t frames, Stats* stats) const {
  if (queries_ == VK_NULL_HANDLE) return absl::OkStatus();
  std::array<uint64_t, kFramesPerSubmit * kQueriesPerFrame> ticks;
  const uint32_t count = frames * kQueriesPerFrame;
  LL_VK_RETURN_IF_ERROR(
      "vkGetQueryPoolResults",
      vkGetQueryPoolResults(device_->handle(), queries_, 0, count, count * sizeof(uint64_t), ticks.data(),
                            sizeof(uint64_t), VK_QUERY_RESULT_64_BIT | VK_QUERY_RESULT_WAIT_BIT));
  const uint32_t bits = device_->timestamp_bits();
  const uint64_t mask = bits >= 64 ? ~uint64_t{0} : (uint64_t{1} << bits) - 1;
  const double to_ms = static_cast<double>(device_->limits().timestampPeriod) * 1e-6;
  for (uint32_t f = 0; f < frames; ++f) {
    const uint64_t* t = ticks.data() + f * kQueriesPerFrame;
    for (size_t p = 0; p < kPasses; ++p) {
      stats->milliseconds[p] += static_cast<double>((t[p + 1] - t[p]) & mask) * to_ms;
    }
  }
  return absl::OkStatus();
}

absl::Status Runtime::read_irradiance(std::span<float> rgb) {
  return transfer_->download(asset_->array(SurfaceArray::kIrradiance),
                             {reinterpret_cast<uint8_t*>(rgb.data()), rgb.size_bytes()});
}

absl::Status Runtime::reset_feedback() { return transfer_->clear(asset_->array(SurfaceArray::kIrradiance)); }

}  // namespace lightloom
