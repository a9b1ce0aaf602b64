// The part of a texel that lies in open space. A texel may reach into a wall that stands on its surface; light is to be
// averaged over what can be seen.
#pragma once

#include <array>
#include <cstdint>

#include "core/receivers/texels.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

class TexelOpening {
 public:
  /// Of the texel's front or back side. `seed` names the texel. The arguments must outlive it.
  TexelOpening(const RayTracer& tracer, const Object& object, const LightmapUv& uv, const TexelGrid& grid,
               const Texel& texel, bool back, uint64_t seed);

  /// Whether all of the texel counts: nothing stands on it, or no part of it was found open.
  bool whole() const { return whole_; }
  /// Whether a point of the texel lies in open space.
  bool contains(const SurfacePoint& point) const;

 private:
  static constexpr int kSide = 4;  ///< the texel is tested in kSide × kSide parts

  Vec3 lifted(const SurfacePoint& p) const;
  bool anything_stands_on_it(const LightmapUv& uv, const Texel& texel) const;

  const RayTracer& tracer_;
  const Object& object_;
  bool back_;
  bool whole_ = true;
  int open_ = 0;
  std::array<Vec3, kSide * kSide> centres_;  ///< of the `open_` parts in open space, pushed off the surface
};

}  // namespace lightloom
