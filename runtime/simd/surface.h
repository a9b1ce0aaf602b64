// Light and colour of the surface elements, and which tiles of them changed.
#pragma once

#include <atomic>

#include "core/base/vec.h"
#include "runtime/simd/packed.h"
#include "runtime/simd/worker_pool.h"

namespace lightloom::simd {

/// LIGHTLOOM_MAX_ALBEDO: above it albedo is taken as that, so that infinite bounces stay finite.
inline constexpr float kMaxAlbedo = 0.99f;

class Surface {
 public:
  enum Input { kDirect, kAlbedo, kEmission };

  /// All black. `smoothing`: whether smooth() will be called with a share below 1.
  Surface(std::pmr::memory_resource* memory, uint32_t elements, bool smoothing);

  uint32_t elements() const { return elements_; }
  /// Values from element `first` on, packed RGB. Only tiles whose bytes differ count as changed.
  void set(Input input, uint32_t first, std::span<const float> rgb);
  void set_environment(Vec3 radiance) { environment_ = radiance; }
  /// Takes over inputs, E and the sky.
  void inherit(const Surface& before, std::span<const AssetIndex::Kept> kept);
  /// E and B are 0, and every B is looked at again.
  void reset();

  /// Whether radiosity() or smooth() has anything to do.
  bool changed() const;

  /// Computes B of the tiles whose inputs or E changed. Returns how many were looked at.
  uint32_t radiosity(const Kernels& kernels, WorkerPool* pool, float epsilon, float floor);
  /// What the last radiosity() changed: a set of tiles, their number, and the sky.
  const Array<uint64_t>& changed_tiles() const { return changed_tiles_; }
  uint32_t changed_tile_count() const { return changed_tile_count_.load(std::memory_order_relaxed); }
  bool sky_changed() const { return sky_changed_; }
  /// Packed RGB by element, with dead_element and sky_element.
  const float* radiosity_values() const { return radiosity_.data(); }

  /// The new E of elements[0..count); block[colour·kReceiveBlock + i]. No |E| becomes more than π times the greatest
  /// radiance there is, so that feedback stays bounded whatever the asset says. `stays`: E is left to smooth(); otherwise it
  /// moves by as much as its goal does. Threads may write different elements at the same time.
  void receive(const uint32_t* elements, uint32_t count, const float* block, bool stays);
  /// E goes `share` of the way to its goal wherever it is not there yet. REQUIRES: `smoothing` was asked for.
  void smooth(WorkerPool* pool, float share);

  /// S × 3 floats.
  std::span<const float> irradiance() const { return {irradiance_.data(), size_t{3} * elements_}; }
  uint64_t bytes() const;

 private:
  void mark(Array<uint8_t>* tiles, uint32_t tile, std::atomic<bool>* any);
  void find_limit();
  bool smooth_tile(uint32_t tile, float share);

  uint32_t elements_;
  bool smoothing_;
  Array<float> inputs_[3];
  Array<float> irradiance_, target_;  ///< target_: empty without smoothing
  Array<float> radiosity_;
  Array<float> greatest_;  ///< per tile and colour: of |B|
  float limit_[3] = {};    ///< of |E|
  Vec3 environment_;
  // Per tile, a byte each so that threads may set them: B must be looked at; E is not at its target.
  Array<uint8_t> dirty_, moving_;
  std::atomic<bool> any_dirty_{false}, any_moving_{false};
  Array<uint64_t> changed_tiles_;
  std::atomic<uint32_t> changed_tile_count_{0};
  bool sky_changed_ = false;
};

}  // namespace lightloom::simd
