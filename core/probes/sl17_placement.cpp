#include "core/probes/sl17_placement.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "core/probes/density_thinning.h"
#include "core/probes/links.h"
#include "core/probes/voxels.h"

namespace lightloom {
namespace {

constexpr float kVoxelsPerSpacing = 8;

/// Points of a regular grid over the level.
size_t grid_points(const Aabb& bounds, float spacing) {
  double count = 1;
  for (int a = 0; a < 3; ++a) count *= std::floor((static_cast<double>(bounds.hi[a]) - bounds.lo[a]) / spacing) + 1;
  return static_cast<size_t>(count);
}

/// The widest spacing, to 2 %, of a regular grid with so many points over the level.
float spacing_of(const Aabb& bounds, size_t points) {
  const Vec3 size = bounds.size();
  float spacing = std::max({size.x, size.y, size.z, 1e-3f});
  while (grid_points(bounds, spacing) < points) spacing *= 0.98f;
  return spacing;
}

/// Floods from the first empty voxel in front of each front-side receiver.
void flood_open_space(const RayTracer& tracer, const Receivers& receivers, float side, Voxels* voxels) {
  for (const Receiver& r : receivers.all) {
    if (r.back) continue;
    for (int step = 1; step <= 4; ++step) {
      const Vec3 p = r.point.position + r.point.geometric * (0.5f * side * static_cast<float>(step));
      if (!voxels->empty(p)) continue;
      if (tracer.visible(r.point.position, p)) voxels->flood(p);
      break;
    }
  }
}

/// The paper fills the interior: around the outer walls of a level nobody needs probes. A level that is but a plane has
/// nothing inside of its bounds; then all of them.
std::vector<Vec3> inside_of(const Aabb& bounds, std::vector<Vec3> points) {
  std::vector<Vec3> inside;
  for (const Vec3 p : points) {
    bool in = true;
    for (int a = 0; a < 3; ++a) in &= p[a] > bounds.lo[a] && p[a] < bounds.hi[a];
    if (in) inside.push_back(p);
  }
  return inside.empty() ? points : inside;
}

/// With the cells of a world grid, and numbers within each, as names.
std::vector<Probe> name_probes(const std::vector<Vec3>& points, float spacing) {
  std::map<std::array<int32_t, 3>, uint32_t> in_cell;
  std::vector<Probe> out;
  for (const Vec3 p : points) {
    const auto cell = probe_cell(p, spacing);
    out.push_back({p, cell, in_cell[cell]++});
  }
  std::sort(out.begin(), out.end(), [](const Probe& a, const Probe& b) { return a.name() < b.name(); });
  return out;
}

}  // namespace

absl::StatusOr<PlacementResult> place_probes_sl17(const RayTracer& tracer, Receivers* receivers,
                                                  const Sl17Options& options, const Parallel& parallel) {
  const Aabb bounds = tracer.scene().bounds();
  const size_t wanted = static_cast<size_t>(options.count);
  const float spacing = wanted > 0 ? spacing_of(bounds, wanted) : options.spacing;
  const float side = spacing / kVoxelsPerSpacing;
  if (const double count = Voxels::count_for(bounds, side); count > Voxels::kMost) {
    return absl::InvalidArgumentError(
        "--method sl17 would need " + std::to_string(static_cast<uint64_t>(count)) +
        " voxels for this level, more than 2^26: give a --spacing of at least " +
        std::to_string(spacing * static_cast<float>(std::cbrt(count / Voxels::kMost)) * 1.05f));
  }
  Voxels voxels(tracer.scene(), side);
  flood_open_space(tracer, *receivers, side, &voxels);
  const std::vector<Vec3> candidates = inside_of(bounds, voxels.connected_near_surfaces());
  if (candidates.empty()) {
    return absl::InvalidArgumentError(
        "--method sl17 found no empty voxel next to a surface: give a smaller --spacing than " +
        std::to_string(spacing));
  }
  const size_t target = wanted > 0 ? wanted : grid_points(bounds, spacing);
  PlacementResult result;
  result.probes = name_probes(thin_by_density(candidates, spacing, target), options.spacing);
  result.radius = support_radius(result.probes, *receivers, options.overlap);

  const ProbeGrid grid(result.probes, options.spacing);
  LL_RETURN_IF_ERROR(drop_unseen_backs(
      tracer, result.probes, [&](Vec3 p) { return grid.within(p, result.radius); }, receivers, parallel));
  return result;
}

float support_radius(std::span<const Probe> probes, const Receivers& receivers, int overlap) {
  if (probes.empty() || receivers.all.empty()) return 0;
  Aabb box;
  for (const Probe& p : probes) box.extend(p.position);
  for (const Receiver& r : receivers.all) box.extend(r.point.position);
  const float longest = length(box.size());
  // The distance that overlap · receivers of all distances do not exceed.
  constexpr size_t kBins = 65536;
  std::vector<uint64_t> bins(kBins + 1, 0);
  for (const Receiver& r : receivers.all) {
    for (const Probe& p : probes) {
      const float share = length(r.point.position - p.position) / longest;
      ++bins[static_cast<size_t>(share * static_cast<float>(kBins))];
    }
  }
  const uint64_t wanted = std::min(static_cast<uint64_t>(overlap), uint64_t{probes.size()}) * receivers.all.size();
  uint64_t count = 0;
  size_t bin = 0;
  while (bin <= kBins && count < wanted) count += bins[bin++];
  return longest * static_cast<float>(bin) / static_cast<float>(kBins);
}

}  // namespace lightloom
