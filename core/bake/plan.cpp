#include "core/bake/plan.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "core/base/sampling.h"
#include "core/base/sh.h"
#include "core/base/stopwatch.h"
#include "core/probes/sl17_placement.h"

namespace lightloom {
namespace {

/// Probe cells are counted in int32, and a level has as many as fit its bounds.
absl::Status check_spacing(float spacing, const Aabb& bounds) {
  if (bounds.empty()) return absl::OkStatus();  // nothing to bake is said elsewhere
  constexpr double kMostCells = 4096;           // along a side of the level
  constexpr double kFarthest = 1 << 30;         // cells from the origin
  double side = 0, farthest = 0;
  for (int a = 0; a < 3; ++a) {
    side = std::max(side, static_cast<double>(bounds.hi[a]) - static_cast<double>(bounds.lo[a]));
    farthest =
        std::max({farthest, std::abs(static_cast<double>(bounds.lo[a])), std::abs(static_cast<double>(bounds.hi[a]))});
  }
  const double least = std::max(side / kMostCells, farthest / kFarthest);
  if (spacing >= least && spacing <= 1e6f) return absl::OkStatus();
  return absl::InvalidArgumentError("--spacing is " + std::to_string(spacing) + " m; this level takes " +
                                    std::to_string(least) + " to 1000000 m, or 0: chosen from the level");
}

/// Rays keep a distance from surfaces that grows with that from the origin, as the rounding of floats does. Where it is
/// no longer small against a texel, light would be gathered from beside the surface, and from behind thin ones.
absl::Status check_place(const Aabb& bounds, float texels_per_metre) {
  if (bounds.empty() || !(texels_per_metre > 0)) return absl::OkStatus();
  const Vec3 farthest{std::max(std::abs(bounds.lo.x), std::abs(bounds.hi.x)),
                      std::max(std::abs(bounds.lo.y), std::abs(bounds.hi.y)),
                      std::max(std::abs(bounds.lo.z), std::abs(bounds.hi.z))};
  const float offset = RayTracer::offset(farthest), texel = 1 / texels_per_metre;
  if (offset <= 0.25f * texel) return absl::OkStatus();
  return absl::InvalidArgumentError(
      "texels of " + std::to_string(texel) + " m are too small where this level lies: up to " +
      std::to_string(std::max({farthest.x, farthest.y, farthest.z})) + " m from the origin, where rays keep " +
      std::to_string(offset) + " m off surfaces; move the level to the origin, or lower --texels-per-metre");
}

/// Octree over the world: the root is the same for every level of one spacing, so a leaf depends on the receivers above it
/// only.
class Octree {
 public:
  Octree(const Receivers& receivers, const BakeParams& params)
      : receivers_(receivers), spacing_(params.spacing), limit_(static_cast<uint32_t>(params.cell_receivers)) {}

  std::vector<PlannedCell> leaves(std::vector<uint32_t> all) {
    split(kRootLevel + 1, {0, 0, 0}, std::move(all), true);
    return std::move(leaves_);
  }

 private:
  static constexpr int32_t kRootLevel = 20;   // a million spacings around the origin
  static constexpr int32_t kLeafLevel = -10;  // a heap of receivers within a thousandth of one stays one cell

  void split(int32_t level, GridCell cell, std::vector<uint32_t> receivers, bool root) {
    if (receivers.empty()) return;
    if (!root && (receivers.size() < limit_ || level <= kLeafLevel)) {
      leaves_.push_back({level, cell, std::move(receivers)});
      return;
    }
    const double side = cell_side(spacing_, level - 1);
    std::array<std::vector<uint32_t>, 8> children;
    std::array<GridCell, 8> cells{};
    for (size_t o = 0; o < 8; ++o) {
      for (size_t a = 0; a < 3; ++a) {
        const int32_t bit = static_cast<int32_t>(o >> (2 - a) & 1);
        cells[o][a] = root ? bit - 1 : 2 * cell[a] + bit;
      }
    }
    for (const uint32_t r : receivers) {
      size_t o = 0;
      for (size_t a = 0; a < 3; ++a) {
        const auto i = static_cast<int64_t>(std::floor(receivers_.all[r].point.position[static_cast<int>(a)] / side));
        const int64_t lowest = root ? -1 : 2 * static_cast<int64_t>(cell[a]);
        if (i > lowest) o |= 4u >> a;
      }
      children[o].push_back(r);
    }
    receivers.clear();
    receivers.shrink_to_fit();
    for (size_t o = 0; o < 8; ++o) split(level - 1, cells[o], std::move(children[o]), false);
  }

  const Receivers& receivers_;
  float spacing_;
  uint32_t limit_;
  std::vector<PlannedCell> leaves_;
};

}  // namespace

Parallel BakeControl::stage(const std::string& name) const {
  Parallel how;
  how.threads = threads;
  how.cancel = cancel;
  if (progress) {
    how.progress = [report = progress, name](uint64_t done, uint64_t total) { report(name, done, total, 0); };
  }
  return how;
}

absl::Status check_params(const BakeParams& p) {
  const auto bad = [](const std::string& what) { return absl::InvalidArgumentError(what); };
  if (p.method > BakeMethod::kSl17) return bad("--method must be default or sl17");
  if (p.order < 0 || p.order > kMaxShOrder) return bad("--order must be 0 to " + std::to_string(kMaxShOrder));
  if (!(p.spacing >= 0) || !std::isfinite(p.spacing)) return bad("--spacing must be a positive number of metres");
  if (!(p.near_field >= 0 || p.near_field == BakeParams::kFollows) || !std::isfinite(p.near_field)) {
    return bad("--near-field must be 0 or a positive number of metres");
  }
  if (p.method == BakeMethod::kSl17 && p.near_field != 0) {
    return bad("--near-field goes with --method default: sl17 has none");
  }
  if (p.probes < 0 || p.probes > 1 << 20) return bad("--probes must be 0 to 1048576");
  if (p.probes > 0 && p.method != BakeMethod::kSl17) {
    return bad("--probes goes with --method sl17; otherwise --spacing decides");
  }
  if (p.links < 1 || p.links > 64) return bad("--links must be 1 to 64");
  if (p.rays < 1 || p.rays > 65536) return bad("--rays must be 1 to 65536");
  if (p.relight_rays < 1 || p.relight_rays > 1 << 20) return bad("--relight-rays must be 1 to 1048576");
  if (p.max_rank < 0 || p.max_rank > 256) return bad("--max-rank must be 0 to 256");
  if (!(p.threshold >= 0 && p.threshold <= 1)) return bad("--threshold must be 0 to 1: it is a share of the transport");
  if (!(p.average >= 0 && p.average <= 16)) return bad("--average must be 0 to 16 texels");
  if (p.method == BakeMethod::kSl17 && p.average != 0)
    return bad("--average goes with --method default: sl17 has none");
  if (p.cell_receivers < 16 || p.cell_receivers > 1 << 16) return bad("--cell-receivers must be 16 to 65536");
  if (!(p.texels_per_metre >= 0) || !std::isfinite(p.texels_per_metre)) return bad("--texels-per-metre must be ≥ 0");
  if (p.lightmap_size < 0 || p.lightmap_size > kMaxLightmapSide) {
    return bad("--lightmap-size must be 0 to " + std::to_string(kMaxLightmapSide));
  }
  return absl::OkStatus();
}

absl::StatusOr<Plan> make_plan(const RayTracer& tracer, const BakeParams& request, const BakeControl& control) {
  LL_ASSIGN_OR_RETURN(Plan ground, find_ground(tracer, request, control));
  return finish_plan(tracer, std::move(ground), control);
}

absl::StatusOr<Plan> find_ground(const RayTracer& tracer, const BakeParams& request, const BakeControl& control) {
  LL_RETURN_IF_ERROR(check_params(request));
  const Scene& scene = tracer.scene();
  Plan plan;
  plan.params = request;

  // Choose what the request leaves open, and record it.
  plan.params.rays = static_cast<int32_t>(well_stratified(static_cast<uint32_t>(request.rays)));
  if (plan.params.spacing == 0) plan.params.spacing = default_spacing(scene.bounds());
  LL_RETURN_IF_ERROR(check_spacing(plan.params.spacing, scene.bounds()));
  if (plan.params.near_field < 0) plan.params.near_field = kNearField * plan.params.spacing;
  LayoutOptions layout_options;
  layout_options.lightmap_size = request.lightmap_size;
  layout_options.texels_per_metre = request.texels_per_metre;
  LL_ASSIGN_OR_RETURN(plan.layout, make_layout(scene, layout_options));
  plan.params.texels_per_metre = plan.layout.texels_per_metre;
  LL_RETURN_IF_ERROR(check_place(scene.bounds(), plan.layout.texels_per_metre));
  if (plan.layout.mode == LayoutMode::kScene) plan.params.lightmap_size = plan.layout.width;

  const Stopwatch receivers_watch;
  LL_ASSIGN_OR_RETURN(plan.receivers, find_receivers(tracer, plan.layout, control.stage("receivers")));
  plan.seconds_receivers = receivers_watch.seconds();
  if (plan.receivers.all.empty()) {
    return absl::InvalidArgumentError(
        "no lightmap texel lies in open space: give the level static objects that receive a lightmap, and check that "
        "its normals do not all point into solids");
  }
  plan.grid = WorldGrid::around(scene.bounds(), plan.params.spacing);
  return plan;
}

absl::StatusOr<Plan> finish_plan(const RayTracer& tracer, Plan plan, const BakeControl& control) {
  const Scene& scene = tracer.scene();
  LL_RETURN_IF_ERROR(check_spacing(plan.params.spacing, scene.bounds()));
  const Stopwatch probes_watch;
  if (plan.params.method == BakeMethod::kSl17) {
    const Sl17Options placement{plan.params.spacing, plan.params.probes, plan.params.links};
    LL_ASSIGN_OR_RETURN(plan.placement, place_probes_sl17(tracer, &plan.receivers, placement, control.stage("probes")));
  } else {
    const PlacementOptions placement{plan.params.spacing, plan.params.links + kFallbacks};
    LL_ASSIGN_OR_RETURN(plan.placement, place_probes(tracer, &plan.receivers, placement, control.stage("probes")));
  }
  plan.seconds_probes = probes_watch.seconds();

  std::vector<uint32_t> all(plan.receivers.all.size());
  for (uint32_t i = 0; i < all.size(); ++i) all[i] = i;
  std::sort(all.begin(), all.end(), [&](uint32_t a, uint32_t b) {
    const Receiver &ra = plan.receivers.all[a], &rb = plan.receivers.all[b];
    if (ra.object == rb.object) return ra.key < rb.key;
    return scene.objects[ra.object].id < scene.objects[rb.object].id;
  });
  plan.cells = Octree(plan.receivers, plan.params).leaves(std::move(all));
  plan.grid = WorldGrid::around(scene.bounds(), plan.params.spacing);
  return plan;
}

Digest scene_hash(const Scene& scene) {
  std::vector<const Object*> objects;
  for (const Object& object : scene.objects) {
    if (object.is_static) objects.push_back(&object);
  }
  std::sort(objects.begin(), objects.end(), [](const Object* a, const Object* b) { return a->id < b->id; });
  Hasher h;
  h.string("scene");
  for (const Object* o : objects) h.digest(o->id).value(o->receive).value(o->texel_scale);
  return h.finish();
}

}  // namespace lightloom
