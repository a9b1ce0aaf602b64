// What stands behind the C API: where the passes of a frame run.
#pragma once

#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "core/base/hash.h"
#include "core/base/status.h"
#include "core/base/vec.h"
#include "runtime/asset_index.h"
#include "runtime/detail.h"
#include "runtime/include/lightloom.h"

namespace lightloom {

enum class SurfaceInput { kDirect, kAlbedo, kEmission };

/// A chunk of the asset: checked, its texels resolved to surface elements.
struct DecodedChunk {
  AssetIndex::Target target;
  // The one that the target is.
  SurfaceChunk surface;
  std::vector<uint32_t> rays;  ///< all of the set's: surface elements, RelightChunk::kDead or kSky
  SourceCell cell;
};

/// Threads as lightloom.h says: load_chunk, unload_chunk, set, set_environment, set_options, reset_feedback, counts and
/// stats may be called from any thread at once; the rest is alone, or on one recording thread.
///
/// Status codes stand for results as boundary.h says.
class Backend {
 public:
  explicit Backend(std::pmr::memory_resource* memory) : memory_(memory) {}
  virtual ~Backend() = default;
  Backend(const Backend&) = delete;
  Backend& operator=(const Backend&) = delete;

  /// Replaces the asset; after a failure there is none.
  absl::Status load_manifest(std::span<const uint8_t> manifest);
  /// As load_manifest, but surface elements of objects that stay keep their inputs and E (AssetIndex::kept_from). A
  /// manifest that is not valid changes nothing.
  absl::Status reload_manifest(std::span<const uint8_t> manifest);
  virtual void unload() = 0;
  bool loaded() const { return index_ != nullptr; }

  // REQUIRES for all below: loaded().
  const AssetIndex& index() const { return *index_; }
  /// What is resident in another detail keeps to light the level until the frame that has all of the new one.
  absl::Status load_chunk(const Digest& digest, std::span<const uint8_t> bytes, const Detail& detail = {});
  /// load_chunk() in two steps.
  absl::StatusOr<DecodedChunk> decode(const Digest& digest, std::span<const uint8_t> bytes) const;
  absl::Status load(DecodedChunk chunk, const Detail& detail);
  absl::Status unload_chunk(const Digest& digest);
  /// Back to the base, at once. Without a base nothing changes.
  absl::Status drop_detail(const Digest& digest);
  /// `rgb` is 3·count finite values for elements [first, …); they exist.
  virtual void set(SurfaceInput input, uint64_t first, std::span<const float> rgb) = 0;
  virtual void set_environment(Vec3 radiance) = 0;
  /// Also before a manifest is loaded; checked, smoothing and fade in (0, 1].
  virtual absl::Status set_options(const lightloom_update_options& options) = 0;
  virtual void reset_feedback() = 0;
  virtual absl::Status update(uint32_t frames) = 0;
  /// `rgb` has 3·S values.
  virtual absl::Status read_irradiance(std::span<float> rgb) = 0;
  virtual lightloom_counts counts() const = 0;
  virtual lightloom_stats stats() const = 0;
  /// Of chunks: loaded, but not yet part of a recorded frame.
  virtual uint64_t pending_bytes() const = 0;

 protected:
  /// For unload.
  void forget();
  /// REQUIRES: nothing is loaded, or, with `kept`, the asset that these are of.
  virtual absl::Status start(std::shared_ptr<const AssetIndex> index, std::span<const AssetIndex::Kept> kept) = 0;

  // Any thread.
  virtual bool resident(const AssetIndex::Target& target, const Detail& detail) const = 0;
  virtual absl::Status load_surface(uint32_t object, const SurfaceChunk& chunk) = 0;
  /// All rays of the chunk: surface elements, RelightChunk::kDead or kSky.
  virtual absl::Status load_relight(uint32_t probe, std::span<const uint32_t> rays, const Detail& detail) = 0;
  /// Limited already.
  virtual absl::Status load_cell(uint32_t cell, const SourceCell& source, const Detail& detail) = 0;
  virtual void unload_target(const AssetIndex::Target& target) = 0;
  virtual void drop_target_detail(const AssetIndex::Target& target) = 0;

  std::pmr::memory_resource* const memory_;

 private:
  SurfaceKeys keys_of(uint32_t object) const;

  std::shared_ptr<const AssetIndex> index_;
  mutable std::mutex keys_mutex_;
  std::vector<SurfaceKeys> keys_;  ///< per object; null: its surface is not resident
};

}  // namespace lightloom
