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
  SimdBackend(const Options& options, std::pmr::memory_resource* memory) : Backend(memory), options_(options) {
    update_options_.smoothing = update_options_.fade = 1;
  }

  void unload() override;
  void set(SurfaceInput input, uint64_t first, std::span<const float> rgb) override;
  void set_environment(Vec3 radiance) override { runtime_->set_environment(radiance); }
  absl::Status set_options(const lightloom_update_options& options) override;
  void reset_feedback() override { runtime_->reset_feedback(); }
  absl::Status update(uint32_t frames) override;
  absl::Status read_irradiance(std::span<float> rgb) override;
  lightloom_counts counts() const override;
  lightloom_stats stats() const override;
  uint64_t pending_bytes() const override { return 0; }

 protected:
  absl::Status start(std::shared_ptr<const AssetIndex> index, std::span<const AssetIndex::Kept> kept) override;
  bool resident(const AssetIndex::Target& target, const Detail& detail) const override;
  absl::Status load_surface(uint32_t object, const SurfaceChunk& chunk) override;
  absl::Status load_relight(uint32_t probe, std::span<const uint32_t> rays, const Detail& detail) override;
  absl::Status load_cell(uint32_t cell, const SourceCell& source, const Detail& detail) override;
  void unload_target(const AssetIndex::Target& target) override;
  void drop_target_detail(const AssetIndex::Target& target) override;

 private:
  absl::Status check_budget(uint64_t more, uint64_t less) const;

  const Options options_;
  std::unique_ptr<SimdRuntime> runtime_;
  std::vector<uint32_t> coarse_rays_;

  mutable std::mutex mutex_;  ///< guards all below, and that the budget holds
  lightloom_update_options update_options_{};
  std::vector<bool> surfaces_;  ///< per object: resident
  /// What is resident of a chunk.
  struct Details {
    std::optional<Detail> now, base;
    bool has(const Detail& detail) const { return now == detail || base == detail; }
  };
  /// Whether another one is to be loaded over what is there.
  static absl::StatusOr<bool> goes_over_base(const Details& details, const Detail& detail);
  static void note(const Detail& detail, bool over_base, Details* details);
  std::vector<Details> probes_, cells_;
};

}  // namespace lightloom
