// What stands behind the C API: where the passes of a frame run.
#pragma once

#include <span>

#include "core/base/hash.h"
#include "core/base/status.h"
#include "core/base/vec.h"
#include "runtime/include/lightloom.h"

namespace lightloom {

enum class SurfaceInput { kDirect, kAlbedo, kEmission };

/// Threads as lightloom.h says: load_chunk, unload_chunk, set, set_environment, set_options, reset_feedback, counts and
/// stats may be called from any thread at once; the rest is alone, or on one recording thread.
///
/// Status codes stand for results as boundary.h says.
class Backend {
 public:
  virtual ~Backend() = default;

  /// Replaces the asset; after a failure there is none.
  virtual absl::Status load_manifest(std::span<const uint8_t> manifest) = 0;
  virtual void unload() = 0;
  virtual bool loaded() const = 0;

  // REQUIRES for all below: loaded().
  /// Calls `visit` for each chunk of the manifest, surfaces first; stops at the first error.
  virtual absl::Status for_each_chunk(absl::Status (*visit)(void* user, const Digest& digest, uint64_t size),
                                      void* user) const = 0;
  virtual absl::Status load_chunk(const Digest& digest, std::span<const uint8_t> bytes) = 0;
  virtual absl::Status unload_chunk(const Digest& digest) = 0;
  virtual uint64_t surface_elements() const = 0;
  /// `rgb` is 3·count finite values for elements [first, …); they exist.
  virtual void set(SurfaceInput input, uint64_t first, std::span<const float> rgb) = 0;
  virtual void set_environment(Vec3 radiance) = 0;
  /// Also before a manifest is loaded; checked, smoothing in (0, 1].
  virtual absl::Status set_options(const lightloom_update_options& options) = 0;
  virtual void reset_feedback() = 0;
  virtual absl::Status update(uint32_t frames) = 0;
  /// `rgb` has 3·S values.
  virtual absl::Status read_irradiance(std::span<float> rgb) = 0;
  virtual lightloom_counts counts() const = 0;
  virtual lightloom_stats stats() const = 0;
};

}  // namespace lightloom
