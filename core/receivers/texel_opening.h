// The part of a texel that lies in open space. A texel may reach into a wall that stands on its surface; light is to be
// averaged over what can be seen. Nor may it be averaged over both sides of a sheet.
#pragma once

#include <cstdint>
#include <vector>

#include "core/receivers/surface_point.h"
#include "core/receivers/texels.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {

/// A texel is tested in kTexelParts × kTexelParts parts.
inline constexpr int kTexelParts = 4;

/// A point of each of a texel's parts, pushed off the surface, at least one: averages over them stand for the texel. `parts`
/// as TexelOpening::parts() has them.
std::vector<ShadingPoint> texel_points(const Object& object, const LightmapUv& uv, const TexelGrid& grid,
                                       const Texel& texel, bool back, uint32_t parts);

class TexelOpening {
 public:
  /// Of the texel's front or back side. `seed` names the texel. The arguments must outlive it.
  TexelOpening(const RayTracer& tracer, const Object& object, const LightmapUv& uv, const TexelGrid& grid,
               const Texel& texel, bool back, uint64_t seed);

  /// Whether all of the texel counts: nothing stands on it, or keeps parts of it apart, or no part of it was found open.
  bool whole() const { return whole_; }
  /// Whether a point of the texel lies in open space.
  bool contains(const SurfacePoint& point) const;
  /// A bit for each of its parts that lie in the same open space, the one that has most of them; 0 if it is whole. Above
  /// these 16 bits: where in each part its point lies, 0 the middle, 1 to 4 the middles of its quarters, which are looked at
  /// where no middle is open.
  uint32_t parts() const { return parts_; }
  /// The middle of the open part that lies most in the midst of them; the texel's own point if it is whole.
  ShadingPoint middle() const;

 private:
  ShadingPoint lifted(const SurfacePoint& p) const { return shading_point(object_, p.triangle, p.b1, p.b2, back_); }
  bool anything_stands_on_it() const;

  const RayTracer& tracer_;
  const Object& object_;
  const LightmapUv& uv_;
  const Texel& texel_;
  bool back_;
  bool whole_ = true;
  uint32_t parts_ = 0;
  std::vector<ShadingPoint> open_;  ///< points of the open parts, if it is not whole
};

}  // namespace lightloom
