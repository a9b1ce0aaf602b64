// Shape and adjacency of an object's triangles, as the chart builder needs them.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "core/scene/scene.h"

namespace lightloom {

struct MeshTopology {
  static constexpr uint32_t kNone = 0xffffffffu;

  std::vector<Vec3> normal;  ///< per triangle: geometric, unit; zero for degenerate triangles
  std::vector<double> area;  ///< per triangle, m²; zero for degenerate triangles
  /// Per triangle: two per edge, kNone where absent. Three or more triangles on one edge are linked as a
  /// chain in index order. Degenerate triangles have none.
  std::vector<std::array<uint32_t, 6>> neighbours;

  bool degenerate(uint32_t t) const { return area[t] == 0; }
};

/// Vertices are the same where their positions are exactly equal. Triangles that are needles beyond float
/// precision or not finite are degenerate. REQUIRES: indices within the object's positions.
MeshTopology build_topology(const Object& object);

/// Connected components of `triangles`, each in the order of `triangles`, sorted by first appearance.
/// `label` is scratch, one per triangle of the mesh, all kNone before and after.
std::vector<std::vector<uint32_t>> connected_components(const MeshTopology& mesh,
                                                        const std::vector<uint32_t>& triangles,
                                                        std::vector<uint32_t>* label);

/// Area of a triangle in m² from double differences; not finite where a corner is not.
double triangle_area(const Object& object, const Triangle& triangle);

}  // namespace lightloom
