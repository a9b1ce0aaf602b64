#include "cli/view/picking.h"

#include <cmath>

namespace lightloom::view {
namespace {

/// Half the height and width of the picture, one metre before the camera.
Vec2 half_size(const Camera& camera) {
  const float half = std::tan(camera.yfov / 2);
  return {half * camera.aspect, half};
}

}  // namespace

Ray ray_through(const Camera& camera, Vec2 at) {
  const Vec2 half = half_size(camera);
  const Vec3 d = camera.forward + camera.right * ((2 * at.x - 1) * half.x) + camera.up * ((1 - 2 * at.y) * half.y);
  return {camera.position, normalize(d)};
}

std::optional<Vec2> on_screen(const Camera& camera, Vec3 point) {
  const Vec3 d = point - camera.position;
  const float depth = dot(d, camera.forward);
  if (!(depth > 1e-4f)) return std::nullopt;
  const Vec2 half = half_size(camera);
  return Vec2{0.5f + 0.5f * dot(d, camera.right) / (depth * half.x),
              0.5f - 0.5f * dot(d, camera.up) / (depth * half.y)};
}

std::optional<size_t> pick_object(const RayTracer& tracer, const Camera& camera, Vec2 at) {
  const Ray ray = ray_through(camera, at);
  const Hit hit = tracer.closest(ray.origin, ray.direction);
  if (!hit) return std::nullopt;
  return hit.object;
}

Vec3 drag_in_view(const Camera& camera, Vec3 point, Vec2 from, Vec2 to) {
  const Vec2 half = half_size(camera);
  const float depth = dot(point - camera.position, camera.forward);
  return camera.right * (2 * (to.x - from.x) * half.x * depth) - camera.up * (2 * (to.y - from.y) * half.y * depth);
}

}  // namespace lightloom::view
