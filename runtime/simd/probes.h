// The probes: what their rays hit, their radiance λ, and which of them saw a change.
#pragma once

#include <vector>

#include "runtime/simd/surface.h"
#include "runtime/simd/turns.h"

namespace lightloom::simd {

class Probes {
 public:
  /// No probe is resident; λ = 0.
  Probes(std::pmr::memory_resource* memory, const AssetIndex& index);

  bool resident(uint32_t probe) const { return packed_[probe].elements.size() != 0; }
  uint64_t bytes_of(uint32_t probe) const { return packed_[probe].bytes(); }
  uint32_t resident_count() const { return resident_; }
  uint32_t waiting() const { return turns_.waiting(); }
  /// Replaces the probe if it is resident, or `over_base`, puts it above the one that is. REQUIRES: `packed` has the manifest's rays, or the coarse_rays() of them.
  void load(uint32_t probe, PackedProbe packed, bool over_base);
  /// Back to the base, if there is one; whether there was.
  bool drop_detail(uint32_t probe);
  /// Its λ stays what it was.
  void unload(uint32_t probe);
  /// λ = 0, and every resident probe waits.
  void reset();

  /// Notes the probes that see what changed.
  void select(const Surface& surface, WorkerPool* pool);
  /// Relights at most `most` (0: all) of those that wait. Returns the probes; changed(probe) says whether the λ of one
  /// became another. Valid until the next call.
  std::span<const uint32_t> relight(const Kernels& kernels, WorkerPool* pool, const float* radiosity, uint32_t most);
  bool changed(uint32_t probe) const { return flags_[probe] != 0; }

  /// Rays of the probes of the last relight().
  uint64_t relit_rays() const { return relit_rays_; }
  /// [probe][colour][lambda_stride]
  const float* lambda() const { return lambda_.data(); }
  uint32_t lambda_stride() const { return lambda_stride_; }
  uint64_t bytes() const { return bytes_; }

 private:
  /// Relight sets of so many rays, and Y of their directions (RelightJob::sh).
  struct Rays {
    uint32_t count = 0;
    Array<float> sh;
  };
  const Rays& rays_of(uint32_t probe) const { return packed_[probe].elements.size() == all_.count ? all_ : coarse_; }
  void relight_group(const Kernels& kernels, const float* radiosity, std::span<const uint32_t> probes);

  uint32_t lambda_stride_;
  Rays all_, coarse_;
  uint64_t relit_rays_ = 0;
  std::pmr::vector<PackedProbe> packed_;
  std::pmr::vector<PackedProbe> base_;  ///< beneath it
  Array<float> lambda_;
  Array<uint32_t> grouped_;  ///< of relight()
  /// Per probe: sees a change, then λ has changed. Bytes, so that threads may write neighbours.
  Array<uint8_t> flags_;
  Turns turns_;
  uint32_t resident_ = 0;
  uint64_t bytes_ = 0;
};

}  // namespace lightloom::simd
