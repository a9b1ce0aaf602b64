// Which texels of an object's lightmap hold surface, and where.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "core/base/sampling.h"
#include "core/base/vec.h"
#include "core/receivers/atlas.h"
#include "core/scene/scene.h"

namespace lightloom {

/// A part of a triangle inside one texel.
struct Fragment {
  uint32_t triangle = 0;
  float area = 0;  ///< m²
};

/// A texel that surface covers. Its point is the texel's centre where a triangle covers it, else the centroid of the
/// largest fragment.
struct Texel {
  uint32_t x = 0, y = 0;
  uint32_t triangle = 0;
  float b1 = 0, b2 = 0;  ///< of the point in `triangle`
  bool centre_covered = false;
  float area = 0;                              ///< m² of surface inside the texel
  uint32_t first_fragment = 0, fragments = 0;  ///< range of TexelGrid::fragments
};

/// Texels in row order (y, then x).
struct TexelGrid {
  int width = 0, height = 0;
  std::vector<Texel> texels;
  std::vector<Fragment> fragments;
};

/// Conservative rasterisation of the object's lightmap. A texel is kept if a triangle covers its centre or surface
/// covers ≥ 1/16 of it, or if a triangle would otherwise have no texel at all.
TexelGrid rasterise(const Object& object, const LightmapUv& uv);

enum class Footprint : uint8_t {
  kTexel,   ///< uniform by area over the surface in the texel that continues the surface at its point
  kCycles,  ///< as Blender Cycles 3.4 bakes: the middle half of the texel, mirrored into the triangle of its centre
};

struct SurfacePoint {
  uint32_t triangle = 0;
  float b1 = 0, b2 = 0;
};

/// The surface at (u, v) of the texel's unit square, if it continues the surface at the texel's point: other charts may
/// share the texel.
std::optional<SurfacePoint> surface_at(const Object& object, const LightmapUv& uv, const TexelGrid& grid,
                                       const Texel& texel, Sample2 at);

/// A point on the surface in the texel, for a jitter uniform in the unit square: averages over many are the texel's
/// value. Points that `accept` says false of are drawn again. REQUIRES for kCycles, which accepts all: the texel's
/// centre is covered.
SurfacePoint sample_texel(const Object& object, const LightmapUv& uv, const TexelGrid& grid, const Texel& texel,
                          Sample2 jitter, Footprint footprint = Footprint::kTexel,
                          const std::function<bool(const SurfacePoint&)>& accept = nullptr);

/// Metres per texel around a triangle, 0 if it has no extent in uv.
float texel_size(const Object& object, const LightmapUv& uv, uint32_t triangle);

/// Unit normal of the front side by winding.
Vec3 geometric_normal(const Object& object, uint32_t triangle);

}  // namespace lightloom
