// Where each light's shadow maps look.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/status.h"
#include "core/scene/scene.h"
#include "runtime/renderer/shaders/frame.h"

namespace lightloom::renderer {

struct ShadowViews {
  std::vector<gpu::ViewData> views;  ///< point: +X −X +Y −Y +Z −Z; spot, directional: one. Layer i is view i's.
  std::vector<gpu::LightData> lights;
};

/// How many views these lights have.
uint32_t shadow_view_count(const std::vector<Light>& lights);

/// Vulkan clip space, depth 0 near to 1 far. A point light's six frusta overlap by a few texels, so that a filter
/// never looks past an edge; a directional light's box holds all of `bounds`. `size`: texels along a side.
ShadowViews make_shadow_views(const std::vector<Light>& lights, const Aabb& bounds, uint32_t size);

/// The camera's view and projection: reversed depth, 1 near to 0 at infinity.
gpu::mat4 camera_matrix(const Camera& camera);

}  // namespace lightloom::renderer
