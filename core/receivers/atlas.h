// Lightmap parametrisation of one object that brings no TEXCOORD_1.
//
// Charts grow over edge-adjacent triangles while their normals agree, are laid flat by projection, split
// where the projection overlaps itself, and are packed by stb_rect_pack. Depends on the object's triangles
// and the texel density only, never on other objects.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/base/status.h"
#include "core/scene/scene.h"

namespace lightloom {

/// Lightmap coordinates of an object's triangles, in texels of a width × height grid (texel (x,y) covers
/// [x,x+1)×[y,y+1)).
struct LightmapUv {
  int width = 0, height = 0;
  std::vector<std::array<Vec2, 3>> corners;  ///< one entry per triangle, corners in Triangle::v order
};

struct AtlasOptions {
  float texels_per_metre = 8;
  int gutter = 1;              ///< texels between any two charts, and around the border
  float max_angle_cos = 0.7f;  ///< a chart's triangles keep dot(normal, chart normal) above this
  int max_size = 8192;         ///< error above this side length
};

struct AtlasStats {
  int charts = 0;
  float utilisation = 0;  ///< texels whose centre lies in a triangle, and their gutter, ÷ width·height
};

absl::StatusOr<LightmapUv> generate_atlas(const Object& object, const AtlasOptions& options,
                                          AtlasStats* stats = nullptr);

}  // namespace lightloom
