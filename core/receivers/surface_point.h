// A point of a surface, ready to send rays from: pushed off on the side it looks to.
#pragma once

#include "core/base/sampling.h"
#include "core/base/vec.h"
#include "core/scene/ray_tracer.h"
#include "core/scene/scene.h"

namespace lightloom {

struct ShadingPoint {
  Vec3 position;   ///< pushed off the surface by RayTracer::offset
  Vec3 normal;     ///< unit; interpolated vertex normal of the side
  Vec3 geometric;  ///< unit; by winding, of the side
};

/// The side is the front, or the back if `back`. An interpolated normal that points through the surface is replaced by
/// the geometric one.
inline ShadingPoint shading_point(const Object& object, uint32_t triangle, float b1, float b2, bool back) {
  const Triangle& t = object.triangles[triangle];
  const Vec3 p0 = object.positions[t.v[0]];
  ShadingPoint s;
  s.geometric = normalize(cross(object.positions[t.v[1]] - p0, object.positions[t.v[2]] - p0));
  s.normal = normalize(interpolate(object.normals, t, b1, b2));
  if (back) s.geometric = -s.geometric, s.normal = -s.normal;
  if (!(dot(s.normal, s.geometric) > 0)) s.normal = s.geometric;
  const Vec3 p = interpolate(object.positions, t, b1, b2);
  s.position = p + s.geometric * RayTracer::offset(p);
  return s;
}

/// Turns local direction `d` (about +z) to the point's normal. Directions that would enter the surface, which an
/// interpolated normal allows, are mirrored out: no energy is lost, and a furnace stays a furnace.
inline Vec3 leave(const ShadingPoint& s, Vec3 d) {
  const Vec3 w = to_world(d, s.normal);
  const float c = dot(w, s.geometric);
  return c < 0 ? w - s.geometric * (2 * c) : w;
}

}  // namespace lightloom
