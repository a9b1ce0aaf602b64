// What lies under the mouse, and how far a thing moves when it is dragged.
#pragma once

#include <optional>

#include "core/scene/ray_tracer.h"

namespace lightloom::view {

// Places in the window: x, y in [0, 1], (0, 0) at the top left.

struct Ray {
  Vec3 origin, direction;  ///< direction: unit
};
Ray ray_through(const Camera& camera, Vec2 at);

/// Where a point is seen; none if it is behind the camera.
std::optional<Vec2> on_screen(const Camera& camera, Vec3 point);

/// Index into Scene::objects.
std::optional<size_t> pick_object(const RayTracer& tracer, const Camera& camera, Vec2 at);

/// How far `point` moves, in its plane parallel to the picture, when what is seen at `from` goes to `to`.
Vec3 drag_in_view(const Camera& camera, Vec3 point, Vec2 from, Vec2 to);

}  // namespace lightloom::view
