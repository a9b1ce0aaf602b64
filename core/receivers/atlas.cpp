#include "core/receivers/atlas.h"

#include <absl/strings/str_cat.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "core/receivers/charts.h"
#include "core/receivers/flatten.h"
#include "core/receivers/mesh_topology.h"
#include "core/receivers/rect_packing.h"
#include "core/receivers/texel_raster.h"

namespace lightloom {
namespace {

absl::Status check_arguments(const Object& object, const AtlasOptions& options, double texels_per_metre) {
  const auto error = [&](auto... what) {
    return absl::InvalidArgumentError(absl::StrCat("object '", object.name, "': ", what...));
  };
  if (object.triangles.empty()) return error("has no triangles to lay out in a lightmap");
  if (!(texels_per_metre > 0) || !std::isfinite(texels_per_metre)) {
    return error("texels per metre × texel scale is ", texels_per_metre, "; it must be positive");
  }
  if (!(options.max_angle_cos > 0 && options.max_angle_cos < 1)) {
    return error("max_angle_cos is ", options.max_angle_cos, "; it must lie between 0 and 1");
  }
  if (options.gutter < 0 || options.gutter > 64 || options.max_size < 1 || options.max_size > 32768) {
    return error("gutter ", options.gutter, " or size limit ", options.max_size, " is out of range");
  }
  for (const Triangle& t : object.triangles) {
    for (uint32_t v : t.v) {
      if (v >= object.positions.size()) {
        return error("triangle index ", v, " is beyond its ", object.positions.size(), " vertices");
      }
    }
  }
  return absl::OkStatus();
}

/// Of all texels, those whose centre lies in a triangle and those within `gutter` of one.
float utilisation(const LightmapUv& uv, const std::vector<FlatChart>& charts,
                  const std::vector<RectPosition>& positions, int gutter) {
  const size_t width = static_cast<size_t>(uv.width), height = static_cast<size_t>(uv.height);
  std::vector<bool> used(width * height);
  for (size_t c = 0; c < charts.size(); ++c) {
    for (const GridTriangle& t : charts[c].corners) {
      rasterise(t, {}, 0, [&](int j, int first, int last) {
        const int y = positions[c].y + j;
        for (int yy = std::max(0, y - gutter); yy <= std::min(uv.height - 1, y + gutter); ++yy) {
          const auto row = used.begin() + static_cast<ptrdiff_t>(yy) * uv.width;
          std::fill(row + std::max(0, positions[c].x + first - gutter),
                    row + std::min(uv.width, positions[c].x + last + gutter + 1), true);
        }
        return true;
      });
    }
  }
  return static_cast<float>(static_cast<double>(std::count(used.begin(), used.end(), true)) /
                            static_cast<double>(used.size()));
}

}  // namespace

absl::StatusOr<LightmapUv> generate_atlas(const Object& object, const AtlasOptions& options, AtlasStats* stats) {
  const double texels_per_metre = double{options.texels_per_metre} * object.texel_scale;
  LL_RETURN_IF_ERROR(check_arguments(object, options, texels_per_metre));
  const MeshTopology mesh = build_topology(object);
  const auto too_large = [&] {
    return absl::InvalidArgumentError(absl::StrCat("object '", object.name, "': its lightmap does not fit ",
                                                   options.max_size, " x ", options.max_size,
                                                   " texels; lower the texels per metre or its texel scale"));
  };
  const double texels = std::accumulate(mesh.area.begin(), mesh.area.end(), 0.0) * texels_per_metre * texels_per_metre;
  // Projection shrinks areas by max_angle_cos at most, rounding to whole texels narrows a side by a third at
  // most.
  if (!(texels * options.max_angle_cos * 4 / 9 <= double{1} * options.max_size * options.max_size)) return too_large();
  LL_ASSIGN_OR_RETURN(
      const std::vector<FlatChart> charts,
      flatten_charts(object, mesh, grow_charts(mesh, options.max_angle_cos), texels_per_metre, options.max_size));

  std::vector<RectSize> sizes;
  for (const FlatChart& c : charts) sizes.push_back({c.width, c.height});
  if (sizes.empty()) sizes.push_back({1, 1});  // nothing but degenerate triangles: a place for them
  const int border = 2 * options.gutter;
  const std::optional<Packing> packing = pack_near_square(sizes, options.gutter, options.max_size - border);
  if (!packing) return too_large();
  std::vector<RectPosition> positions = packing->positions;
  for (RectPosition& p : positions) p = {p.x + options.gutter, p.y + options.gutter};

  LightmapUv uv{packing->width + border, packing->height + border, {}};
  // Degenerate triangles shrink to a point inside the first chart.
  const Vec2 somewhere{static_cast<float>(positions[0].x) + 0.5f, static_cast<float>(positions[0].y) + 0.5f};
  uv.corners.assign(object.triangles.size(), {somewhere, somewhere, somewhere});
  for (size_t c = 0; c < charts.size(); ++c) {
    for (size_t i = 0; i < charts[c].triangles.size(); ++i) {
      for (size_t k = 0; k < 3; ++k) {
        const GridPoint p = charts[c].corners[i][k];
        uv.corners[charts[c].triangles[i]][k] = {static_cast<float>(positions[c].x * kGrid + p.x) / kGrid,
                                                 static_cast<float>(positions[c].y * kGrid + p.y) / kGrid};
      }
    }
  }
  if (stats) {
    stats->charts = static_cast<int>(charts.size());
    stats->utilisation = utilisation(uv, charts, positions, options.gutter);
  }
  return uv;
}

}  // namespace lightloom
