// The part of a texel that lies in open space. A texel may reach into a wall that stands on its surface; light is to be
// averaged over what can be seen.
#pragma once

#include <cstdint>
#include <vector>

#include "core/receivers/surface_point.h"
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
  /// The middles of its parts that lie in open space, pushed off the surface; at least one. Averages over them stand for
  /// the texel.
  std::vector<ShadingPoint> points() const;
  /// The one of these that lies most in their midst; the texel's own point if it is whole.
  ShadingPoint middle() const;

 private:
  static constexpr int kSide = 4;  ///< the texel is tested in kSide × kSide parts

  ShadingPoint lifted(const SurfacePoint& p) const { return shading_point(object_, p.triangle, p.b1, p.b2, back_); }
  bool anything_stands_on_it() const;
  std::vector<ShadingPoint> parts() const;

  const RayTracer& tracer_;
  const Object& object_;
  const LightmapUv& uv_;
  const TexelGrid& grid_;
  const Texel& texel_;
  bool back_;
  bool whole_ = true;
  std::vector<ShadingPoint> open_;  ///< parts in open space, if it is not whole
};

}  // namespace lightloom
