// Cuts an object's surface into charts that can be laid flat: groups of connected triangles that face one
// way.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/vec.h"
#include "core/receivers/mesh_topology.h"

namespace lightloom {

struct Chart {
  std::vector<uint32_t> triangles;  ///< in the order they were reached
  Vec3 axis;                        ///< unit: the chart is projected along it
};

/// Every triangle that is not degenerate is in one chart, where dot(normal, axis) > max_angle_cos. Charts may
/// overlap themselves in projection. REQUIRES: 0 < max_angle_cos < 1.
std::vector<Chart> grow_charts(const MeshTopology& mesh, float max_angle_cos);

}  // namespace lightloom
