// The points that the bake solves for: lightmap texels, on each side that lies in open space.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/parallel.h"
#include "core/receivers/layout.h"
#include "core/receivers/surface_point.h"
#include "core/receivers/texels.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// A texel side in open space. Its key names it within its object: side·w·h + y·w + x, side 0 the front, 1 the back.
struct Receiver {
  uint32_t object = 0;  ///< index into Scene::objects
  uint32_t key = 0;
  uint32_t texel = 0;  ///< index into the object's TexelGrid::texels
  bool back = false;
  ShadingPoint point;  ///< TexelOpening::middle()
  uint32_t parts = 0;  ///< TexelOpening::parts(): where its rays start
  uint64_t seed = 0;   ///< receiver_seed()
};

/// All randomness of a receiver comes from here, and what of its texel is open, in bakes and in the truth.
inline uint64_t receiver_seed(const Object& object, uint32_t key) { return hash_combine(object.id.low64(), key); }

struct Receivers {
  static constexpr uint32_t kNone = 0xffffffffu;

  std::vector<TexelGrid> grids;  ///< per object
  std::vector<Receiver> all;     ///< by object, keys ascending within each
  struct Range {
    uint32_t begin = 0, end = 0;
  };
  std::vector<Range> ranges;  ///< per object, its part of `all`
  uint64_t solid_texels = 0;  ///< front sides dropped as inside solids

  /// Drops the receivers that `keep` (one entry per receiver) says false of.
  void retain(const std::vector<bool>& keep);
  /// Index into `all`, or kNone.
  uint32_t find(uint32_t object, uint32_t key) const;
};

/// Rasterises every object's lightmap and keeps the sides in open space. A side is solid if at least half of its
/// rays meet a back face first, whatever the material says. Backs are kept of double-sided materials only, and only
/// where an eighth of the rays hit anything: a shell's outside that faces the void has nothing to gather.
absl::StatusOr<Receivers> find_receivers(const RayTracer& tracer, const AtlasLayout& layout, const Parallel& parallel);

}  // namespace lightloom
