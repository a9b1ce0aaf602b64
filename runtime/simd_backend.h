// The passes on the processor's vector units behind the C API.
#pragma once

#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "runtime/asset_index.h"
#include "runtime/backend.h"
#include "runtime/simd/simd_runtime.h"

namespace lightloom {

class SimdBackend final : public Backend {
 public:
  struct Options {
    uint32_t threads = 0;  ///< 0: one per hardware thread
    bool smoothing = false;
    uint64_t byte_budget = 0;  ///< 0: no limit
  };
  SimdBackend(const Options& options, std::pmr::memory_resource* memory) : options_(options), memory_(memory) {
    update_options_.smoothing = 1;
  }

  absl::Status load_manifest(std::span<const uint8_t> manifest) override;
  void unload() override;
  bool loaded() const override { return runtime_ != nullptr; }
  const AssetIndex& index() const override { return *index_; }
  absl::Status load_chunk(const Digest& digest, std::span<const uint8_t> bytes) override;
  absl::Status unload_chunk(const Digest& digest) override;
  void set(SurfaceInput input, uint64_t first, std::span<const float> rgb) override;
  void set_environment(Vec3 radiance) override { runtime_->set_environment(radiance); }
  absl::Status set_options(const lightloom_update_options& options) override;
  void reset_feedback() override { runtime_->reset_feedback(); }
  absl::Status update(uint32_t frames) override;
  absl::Status read_irradiance(std::span<float> rgb) override;
  lightloom_counts counts() const override;
  lightloom_stats stats() const override;

 private:
  absl::Status load_surface(uint32_t object, std::span<const uint8_t> bytes);
  absl::Status load_relight(uint32_t probe, std::span<const uint8_t> bytes);
  absl::Status load_cell(uint32_t cell, std::span<const uint8_t> bytes);
  SurfaceKeys keys_of(uint32_t object) const;
  absl::Status check_budget(uint64_t more) const;

  const Options options_;
  std::pmr::memory_resource* memory_;
  std::optional<AssetIndex> index_;
  std::unique_ptr<SimdRuntime> runtime_;

  mutable std::mutex mutex_;  ///< guards all below, and that the budget holds
  lightloom_update_options update_options_{};
  std::vector<SurfaceKeys> keys_;  ///< per object; null: not resident
};

}  // namespace lightloom
