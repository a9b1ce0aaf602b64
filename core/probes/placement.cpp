#include "core/probes/placement.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "core/base/sampling.h"
#include "core/probes/links.h"
#include "core/receivers/open_space.h"

namespace lightloom {
namespace {

using Cell = std::array<int32_t, 3>;

constexpr int kCandidates = 24;        // fixed points per cell, tried in order
constexpr float kClearance = 0.15f;    // of the spacing
constexpr uint32_t kSpaceRays = 24;    // rays that tell open space from solid
constexpr size_t kTestReceivers = 64;  // per cell, for repair
constexpr uint32_t kTestRaysSide = 4;
constexpr double kRepairShare = 0.01;  // unseen share of a cell's test rays that calls for repair

FirstHits look_around(const RayTracer& tracer, Vec3 p) {
  FirstHits f;
  for (uint32_t i = 0; i < kSpaceRays; ++i) f.add(tracer.closest(p, sphere_direction(i, kSpaceRays)));
  return f;
}

/// Point n of the cell's list, the same in all cells: a level that is moved by cells has the same probes. The middle, then
/// spread by the R3 sequence (Roberts 2018).
Vec3 candidate(const Cell& cell, float spacing, int n) {
  constexpr double kR3[3] = {0.8191725133961645, 0.6710436067037893, 0.5497004779019703};
  Vec3 p;
  for (int a = 0; a < 3; ++a) {
    const double at = 0.5 + n * kR3[a];
    const double u = 0.05 + 0.9 * (at - std::floor(at));
    p[a] = static_cast<float>((cell[static_cast<size_t>(a)] + u) * static_cast<double>(spacing));
  }
  return p;
}

/// First acceptable point: in open space, and not so near a surface that it would crowd the neighbouring cells' probes. A
/// cell of which only slivers are open gets none; repair adds one if it is missed.
std::optional<Vec3> base_point(const RayTracer& tracer, const Cell& cell, float spacing) {
  for (int n = 0; n < kCandidates; ++n) {
    const Vec3 p = candidate(cell, spacing, n);
    const FirstHits f = look_around(tracer, p);
    if (!f.solid() && f.nearest >= kClearance * spacing) return p;
  }
  return std::nullopt;
}

struct Unseen {
  Vec3 from;  // receiver
  Vec3 to;    // what it sees: a point (pushed off), or a direction to the sky
  bool sky = false;

  bool seen_from(const RayTracer& tracer, Vec3 probe) const {
    return sky ? !tracer.occluded(probe, to, std::numeric_limits<float>::infinity()) : tracer.visible(to, probe);
  }
};

/// Test rays of the cell's receivers whose hits no probe within reach sees.
std::vector<Unseen> unseen_hits(const RayTracer& tracer, const Receivers& receivers, std::span<const uint32_t> tested,
                                std::span<const Probe> probes, const ProbeGrid& grid, int reach, uint64_t* rays) {
  const Scene& scene = tracer.scene();
  std::vector<Unseen> out;
  for (const uint32_t r : tested) {
    const Receiver& receiver = receivers.all[r];
    const auto near = grid.nearest(receiver.point.position, reach);
    Rng rng(hash_combine(receiver.seed, 0x4e9a1));
    for (uint32_t i = 0; i < kTestRaysSide * kTestRaysSide; ++i) {
      const Sample2 uv = stratified(i, kTestRaysSide, &rng);
      ++*rays;
      const Vec3 direction = leave(receiver.point, square_to_cosine_hemisphere(uv.u, uv.v));
      const Hit hit = tracer.closest(receiver.point.position, direction);
      Unseen target{receiver.point.position, direction, !hit};
      if (hit) {
        if (is_dark_back(scene, hit)) continue;
        target.to = shading_point(scene.objects[hit.object], hit.triangle, hit.b1, hit.b2, hit.back).position;
      }
      const bool seen = std::any_of(near.begin(), near.end(), [&](const ProbeGrid::Near& n) {
        return target.seen_from(tracer, probes[n.probe].position);
      });
      if (!seen) out.push_back(target);
    }
  }
  return out;
}

/// Greedy cover of the unseen hits by points on the way to them, at most one per octant of the cell.
std::vector<Probe> repair(const RayTracer& tracer, const Cell& cell, float spacing, std::vector<Unseen> unseen,
                          uint64_t rays) {
  constexpr size_t kMaxTargets = 128, kMaxCandidates = 96;
  const auto thin = [](auto* v, size_t n) {
    if (v->size() <= n) return;
    for (size_t i = 0; i < n; ++i) (*v)[i] = (*v)[i * v->size() / n];
    v->resize(n);
  };
  const double share = static_cast<double>(unseen.size()) / static_cast<double>(rays);
  thin(&unseen, kMaxTargets);

  std::vector<Vec3> points;
  for (const Unseen& u : unseen) {
    const Vec3 way = u.sky ? u.to * spacing : u.to - u.from;
    const float distance = length(way);
    for (const float step : {0.1f, 0.3f}) {  // of a cell, but not past the middle
      const Vec3 p = u.from + way * std::min(0.5f, step * spacing / distance);
      if (probe_cell(p, spacing) == cell) points.push_back(p);
    }
  }
  thin(&points, kMaxCandidates);
  std::erase_if(points, [&](Vec3 p) {
    const FirstHits f = look_around(tracer, p);
    return f.solid() || f.nearest < 0.01f * spacing;
  });

  const auto octant = [&](Vec3 p) {
    uint32_t o = 0;
    for (int a = 0; a < 3; ++a) {
      const double u = static_cast<double>(p[a]) / spacing - cell[static_cast<size_t>(a)];
      if (u >= 0.5) o |= 1u << a;
    }
    return o;
  };
  std::vector<std::vector<bool>> sees(points.size());
  for (size_t i = 0; i < points.size(); ++i) {
    for (const Unseen& u : unseen) sees[i].push_back(u.seen_from(tracer, points[i]));
  }
  std::vector<Probe> out;
  std::vector<bool> covered(unseen.size(), false);
  uint32_t used = 0;
  size_t left = unseen.size();
  while (share * static_cast<double>(left) / static_cast<double>(unseen.size()) > kRepairShare / 2) {
    size_t best = points.size(), best_count = 0;
    for (size_t i = 0; i < points.size(); ++i) {
      if (used & 1u << octant(points[i])) continue;
      size_t count = 0;
      for (size_t k = 0; k < covered.size(); ++k) count += !covered[k] && sees[i][k];
      if (count > best_count) best = i, best_count = count;
    }
    if (best == points.size()) break;
    used |= 1u << octant(points[best]);
    out.push_back({points[best], cell, 1 + octant(points[best])});
    for (size_t k = 0; k < covered.size(); ++k) {
      if (!covered[k] && sees[best][k]) covered[k] = true, --left;
    }
  }
  return out;
}

/// Cells with front-side receivers, and cells between two such neighbours: the middle of a room, not the open air around
/// it.
std::vector<Cell> base_cells(const Receivers& receivers, float spacing) {
  std::set<Cell> home;
  for (const Receiver& r : receivers.all) {
    if (!r.back) home.insert(probe_cell(r.point.position, spacing));
  }
  std::set<Cell> cells = home;
  for (const Cell& c : home) {
    for (size_t axis = 0; axis < 3; ++axis) {
      Cell between = c, beyond = c;
      between[axis] += 1;
      beyond[axis] += 2;
      if (home.contains(beyond)) cells.insert(between);
    }
  }
  return {cells.begin(), cells.end()};
}

/// A cell's receivers that repair looks at, and what it found.
struct Home {
  Cell cell{};
  std::vector<uint32_t> tested;
  std::vector<Probe> repairs;
  uint64_t rays = 0, unseen = 0;
};

std::vector<Home> repair_homes(const Receivers& receivers, float spacing) {
  std::map<Cell, std::vector<uint32_t>> by_cell;
  for (uint32_t r = 0; r < receivers.all.size(); ++r) {
    by_cell[probe_cell(receivers.all[r].point.position, spacing)].push_back(r);
  }
  std::vector<Home> homes;
  for (auto& [cell, list] : by_cell) {
    std::sort(list.begin(), list.end(), [&](uint32_t a, uint32_t b) {
      return std::pair(mix64(receivers.all[a].seed), a) < std::pair(mix64(receivers.all[b].seed), b);
    });
    if (list.size() > kTestReceivers) list.resize(kTestReceivers);
    homes.push_back({cell, std::move(list), {}, 0, 0});
  }
  return homes;
}

}  // namespace

absl::Status drop_unseen_backs(const RayTracer& tracer, std::span<const Probe> probes,
                               absl::FunctionRef<std::vector<ProbeGrid::Near>(Vec3)> near, Receivers* receivers,
                               const Parallel& parallel) {
  std::vector<uint8_t> seen(receivers->all.size(), 1);
  const bool done = parallel_for(receivers->all.size(), parallel, [&](uint64_t i) {
    const Receiver& r = receivers->all[i];
    if (!r.back) return;
    const auto found = near(r.point.position);
    seen[i] = std::any_of(found.begin(), found.end(), [&](const ProbeGrid::Near& n) {
      return tracer.visible(r.point.position, probes[n.probe].position);
    });
  });
  if (!done) return absl::CancelledError("cancelled while placing probes");
  receivers->retain(std::vector<bool>(seen.begin(), seen.end()));
  return absl::OkStatus();
}

absl::StatusOr<PlacementResult> place_probes(const RayTracer& tracer, Receivers* receivers,
                                             const PlacementOptions& options, const Parallel& parallel) {
  const float spacing = options.spacing;

  // Base probes.
  const std::vector<Cell> cells = base_cells(*receivers, spacing);
  std::vector<std::optional<Vec3>> points(cells.size());
  if (!parallel_for(cells.size(), parallel, [&](uint64_t i) { points[i] = base_point(tracer, cells[i], spacing); })) {
    return absl::CancelledError("cancelled while placing probes");
  }
  PlacementResult result;
  for (size_t i = 0; i < cells.size(); ++i) {
    if (points[i]) result.probes.push_back({*points[i], cells[i], 0});
  }
  const ProbeGrid grid(result.probes, spacing);

  // Back sides that are seen.
  LL_RETURN_IF_ERROR(drop_unseen_backs(
      tracer, result.probes, [&](Vec3 p) { return grid.nearest(p, options.nearest); }, receivers, parallel));

  // Repairs, each decided from base probes alone.
  std::vector<Home> homes = repair_homes(*receivers, spacing);
  const bool done = parallel_for(homes.size(), parallel, [&](uint64_t i) {
    Home& h = homes[i];
    auto unseen = unseen_hits(tracer, *receivers, h.tested, result.probes, grid, options.nearest, &h.rays);
    h.unseen = unseen.size();
    if (static_cast<double>(h.unseen) > kRepairShare * static_cast<double>(h.rays)) {
      h.repairs = repair(tracer, h.cell, spacing, std::move(unseen), h.rays);
    }
  });
  if (!done) return absl::CancelledError("cancelled while repairing probes");

  uint64_t rays = 0, unseen = 0;
  std::vector<Probe> repairs;
  for (const Home& h : homes) {
    rays += h.rays;
    unseen += h.unseen;
    repairs.insert(repairs.end(), h.repairs.begin(), h.repairs.end());
  }
  result.unseen = rays > 0 ? static_cast<double>(unseen) / static_cast<double>(rays) : 0;
  result.repairs = repairs.size();
  result.probes.insert(result.probes.end(), repairs.begin(), repairs.end());
  std::sort(result.probes.begin(), result.probes.end(),
            [](const Probe& a, const Probe& b) { return a.name() < b.name(); });
  return result;
}

std::vector<Vec3> positions_of(const std::vector<Probe>& probes) {
  std::vector<Vec3> positions;
  positions.reserve(probes.size());
  for (const Probe& p : probes) positions.push_back(p.position);
  return positions;
}

float default_spacing(const Aabb& bounds) {
  const Vec3 size = bounds.size();
  const double longest = std::max({size.x, size.y, size.z});
  if (!(longest > 0)) return 1;
  // A flat level still has a layer of cells.
  double cells = 1;
  for (int a = 0; a < 3; ++a) cells *= std::max<double>(size[a], longest / 16);
  // The least s of two significant digits with s³ ≥ volume ÷ 200. Multiplications only: it is a stored parameter.
  double unit = 1e-6;
  while (unit * unit * unit * 1e6 < cells / 200) unit *= 10;
  int digits = 10;
  while (digits < 100 && unit * digits * (unit * digits) * (unit * digits) < cells / 200) ++digits;
  return static_cast<float>(unit * digits);
}

}  // namespace lightloom
