// Rays against the static geometry of a scene. Embree stands behind it; no Embree type shows.
//
// Hits are a pure function of the triangles near the ray: Embree runs with RTC_SCENE_FLAG_ROBUST and a pinned
// instruction set, t and the barycentrics are recomputed from the triangle with IEEE division, and of hits at nearly the
// same distance the recomputed t decides, or the triangle's content where it is equal.
#pragma once

#include <cstdint>
#include <limits>
#include <memory>

#include "core/base/status.h"
#include "core/base/vec.h"
#include "core/scene/scene.h"

namespace lightloom {

struct Hit {
  uint32_t object = kNone;  ///< index into Scene::objects
  uint32_t triangle = 0;    ///< index into Object::triangles
  float t = std::numeric_limits<float>::infinity();
  float b1 = 0, b2 = 0;  ///< barycentric weights of the second and third vertex
  bool back = false;     ///< the ray came from behind (dot(direction, geometric normal) > 0)

  static constexpr uint32_t kNone = 0xffffffffu;
  explicit operator bool() const { return object != kNone; }
};

/// Of a hit: the back of a single-sided surface, which blocks light, and neither reflects nor emits any.
inline bool is_dark_back(const Scene& scene, const Hit& hit) {
  return hit.back && !scene.materials[scene.objects[hit.object].triangles[hit.triangle].material].double_sided;
}

/// Thread-safe after construction. Keeps a reference to the scene, which must outlive it unchanged.
class RayTracer {
 public:
  static absl::StatusOr<std::unique_ptr<RayTracer>> create(const Scene& scene);
  ~RayTracer();
  RayTracer(const RayTracer&) = delete;
  RayTracer& operator=(const RayTracer&) = delete;

  /// Nearest hit with t in (0, t_max]. `direction` need not be unit; t is in its units. Alpha-masked holes let through.
  Hit closest(Vec3 origin, Vec3 direction, float t_max = std::numeric_limits<float>::infinity()) const;
  /// Whether anything lies at t in (0, t_max].
  bool occluded(Vec3 origin, Vec3 direction, float t_max) const;
  /// Whether the open segment between two points in free space is free. Push points on surfaces off by offset() first.
  bool visible(Vec3 from, Vec3 to) const;

  const Scene& scene() const;
  /// That the acceleration structure takes, without the scene.
  uint64_t bytes() const;
  /// World-space position, geometric unit normal (front side) of a hit.
  Vec3 position(const Hit& hit) const;
  Vec3 geometric_normal(const Hit& hit) const;
  /// How far to push a point off its surface, metres: large against float rounding at these coordinates, small against
  /// any wall. Depends only on the point.
  static float offset(Vec3 point);

 private:
  struct Impl;
  explicit RayTracer(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace lightloom
