// Lays charts flat on the texel grid, without overlap inside a chart.
#pragma once

#include <cstdint>
#include <vector>

#include "core/base/status.h"
#include "core/receivers/charts.h"
#include "core/receivers/texel_raster.h"
#include "core/scene/scene.h"

namespace lightloom {

struct FlatChart {
  std::vector<uint32_t> triangles;
  std::vector<GridTriangle> corners;  ///< per triangle, within [0, width] × [0, height] texels
  int width = 0, height = 0;          ///< whole texels, at least 1
};

/// Projects each chart along its axis to scale, turns it into its smallest rectangle, wider than high, and
/// rounds that to whole texels. Charts that fill little of their rectangle are cut, those that overlap
/// themselves are split: more charts may come out than went in. Error if one is larger than max_size texels.
absl::StatusOr<std::vector<FlatChart>> flatten_charts(const Object& object, const MeshTopology& mesh,
                                                      std::vector<Chart> charts, double texels_per_metre, int max_size);

}  // namespace lightloom
