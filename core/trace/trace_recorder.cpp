#include "core/trace/trace_recorder.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "core/base/check.h"
#include "core/base/octahedral.h"
#include "core/scene/ray_tracer.h"

namespace lightloom {
namespace {

constexpr uint32_t kSkySide = 16;      // cells along the octahedral map of directions
constexpr uint64_t kSky = 1ull << 31;  // above every index of a grid
constexpr uint32_t kOriginShift = 32;
// Of a cell: more than positions are rounded by, and less than anybody would miss.
constexpr float kMargin = 1.0f / 64;
// A probe that was asked decides a part of what a ray carries.
constexpr uint32_t kAskedPart = 8;

static_assert(WorldGrid::kMostCells <= kSky);

}  // namespace

TraceRecorder::TraceRecorder(const WorldGrid& grid, size_t probes)
    : grid_(grid),
      words_((probes + 63) / 64),
      side_(static_cast<float>(grid.side())),
      per_metre_(1 / side_),
      crossed_(grid.cells(), 0) {
  Vec3 farthest;
  for (int a = 0; a < 3; ++a) {
    const size_t n = static_cast<size_t>(a);
    corner_[a] = static_cast<float>(grid.lo[n] * grid.side());
    farthest[a] = std::max(std::abs(corner_[a]), std::abs(corner_[a] + static_cast<float>(grid.size[n]) * side_));
  }
  margin_ = kMargin * side_ + RayTracer::offset(farthest);
}

void TraceRecorder::from(const Aabb& box) {
  const GridCell cell = grid_.cell_at(box.center());
  uint64_t key = 0;
  for (size_t a = 0; a < 3; ++a) key = key << 21 | static_cast<uint32_t>(cell[a] & 0x1fffff);
  const auto [known, is_new] = origin_of_.try_emplace(key, static_cast<uint32_t>(origins_.size()));
  origin_ = known->second;
  if (is_new) origins_.emplace_back();
  origins_[origin_].extend(box.lo);
  origins_[origin_].extend(box.hi);
}

TraceRecorder::Place TraceRecorder::count(uint64_t where) {
  const auto [known, is_new] =
      place_of_.try_emplace(uint64_t{origin_} << kOriginShift | where, static_cast<uint32_t>(places_.size()));
  if (is_new) {
    places_.push_back({where, origin_, 0, 0});
    asked_.resize(asked_.size() + words_);
  }
  ++places_[known->second].rays;
  return known->second;
}

TraceRecorder::Place TraceRecorder::hit(Vec3 p, float reach) {
  uint32_t index = 0;
  for (int a = 0; a < 3; ++a) {
    const uint32_t size = grid_.size[static_cast<size_t>(a)];
    const float at = std::clamp((p[a] - corner_[a]) * per_metre_, 0.0f, static_cast<float>(size - 1));
    index = index * size + static_cast<uint32_t>(at);
  }
  const Place place = count(index);
  places_[place].reach = std::max(places_[place].reach, reach);
  return place;
}

TraceRecorder::Place TraceRecorder::sky(Vec3 direction) {
  const Vec2 at = octahedral(direction);
  const auto along = [](float x) {
    return static_cast<uint32_t>(std::clamp((0.5f + 0.5f * x) * kSkySide, 0.0f, kSkySide - 1.0f));
  };
  return count(kSky | (along(at.y) * kSkySide + along(at.x)));
}

/// Of a place: all that its rays hit, and what was made of it within `reach`. Of the sky: what a ray of it is added to its
/// origin, far away.
Aabb TraceRecorder::box_of(const Seen& seen, float reach) const {
  Aabb box;
  if ((seen.where & kSky) == 0) {
    const GridCell cell = grid_.cell(static_cast<uint32_t>(seen.where));
    for (int a = 0; a < 3; ++a) {
      const float at = static_cast<float>(cell[static_cast<size_t>(a)] - grid_.lo[static_cast<size_t>(a)]);
      box.lo[a] = corner_[a] + at * side_ - reach;
      box.hi[a] = corner_[a] + (at + 1) * side_ + reach;
    }
    return box;
  }
  // On the octahedron a cell of the map is one or two triangles between its corners.
  const uint32_t cell = static_cast<uint32_t>(seen.where & (kSky - 1));
  for (const uint32_t corner : {0u, 1u, kSkySide, kSkySide + 1}) {
    const uint32_t row = cell / kSkySide + corner / kSkySide, column = cell % kSkySide + corner % kSkySide;
    const auto along = [](uint32_t i) { return 2 * static_cast<float>(i) / kSkySide - 1; };
    box.extend(from_octahedral({along(column), along(row)}));
  }
  // |d|₁ = 1: one coordinate grows by a third at least.
  const float far = 4 * side_ * static_cast<float>(std::max({grid_.size[0], grid_.size[1], grid_.size[2]}));
  box.lo *= far;
  box.hi *= far;
  return box;
}

void TraceRecorder::draw(const Aabb& from, const Aabb& to, uint32_t rays) {
  Sweep sweep;
  for (int a = 0; a < 3; ++a) {
    const auto in_cells = [&](float x) { return (x - corner_[a]) * per_metre_; };
    sweep.lo[0][a] = in_cells(from.lo[a] - margin_);
    sweep.hi[0][a] = in_cells(from.hi[a] + margin_);
    sweep.lo[1][a] = in_cells(to.lo[a] - margin_);
    sweep.hi[1][a] = in_cells(to.hi[a] + margin_);
    const float cells = static_cast<float>(grid_.size[static_cast<size_t>(a)]);
    left_grid_ |= std::min(sweep.lo[0][a], sweep.lo[1][a]) < 0 || std::max(sweep.hi[0][a], sweep.hi[1][a]) > cells;
  }
  draw(sweep, rays);
}

/// Slice by slice along the axis that it moves along most: a slice meets it for a span of its way, and across the axis it
/// is widest at one end of the span.
void TraceRecorder::draw(const Sweep& s, uint32_t rays) {
  const auto moves = [&](int a) { return std::abs(s.lo[1][a] + s.hi[1][a] - s.lo[0][a] - s.hi[0][a]); };
  int axis = moves(0) >= moves(1) ? 0 : 1;
  if (moves(2) > moves(axis)) axis = 2;
  const int across[2] = {(axis + 1) % 3, (axis + 2) % 3};
  const uint32_t stride[3] = {grid_.size[1] * grid_.size[2], grid_.size[2], 1};
  const auto cells = [&](int a) { return static_cast<float>(grid_.size[static_cast<size_t>(a)]); };

  const float first = std::max(0.0f, std::floor(std::min(s.lo[0][axis], s.lo[1][axis])));
  const float last = std::min(cells(axis) - 1, std::floor(std::max(s.hi[0][axis], s.hi[1][axis])));
  const float lo_way = s.lo[1][axis] - s.lo[0][axis], hi_way = s.hi[1][axis] - s.hi[0][axis];
  for (float slice = first; slice <= last; ++slice) {
    // lo(t) ≤ slice + 1 and hi(t) ≥ slice
    float t0 = 0, t1 = 1;
    const auto keep_below = [&](float start, float way, float bound) {
      if (way > 0) t1 = std::min(t1, (bound - start) / way);
      if (way < 0) t0 = std::max(t0, (bound - start) / way);
    };
    keep_below(s.lo[0][axis], lo_way, slice + 1);
    keep_below(-s.hi[0][axis], -hi_way, -slice);
    uint32_t begin[2], end[2];
    bool inside = t0 <= t1 + 1e-4f;
    for (int k = 0; k < 2; ++k) {
      const int a = across[k];
      const auto at = [&](const float(&side)[2][3], float t) { return side[0][a] + (side[1][a] - side[0][a]) * t; };
      const float lo = std::min(at(s.lo, t0), at(s.lo, t1)), hi = std::max(at(s.hi, t0), at(s.hi, t1));
      inside = inside && hi >= 0 && lo < cells(a);
      begin[k] = static_cast<uint32_t>(std::clamp(lo, 0.0f, cells(a) - 1));
      end[k] = static_cast<uint32_t>(std::clamp(hi, 0.0f, cells(a) - 1)) + 1;
    }
    if (!inside) continue;
    for (uint32_t i = begin[0]; i < end[0]; ++i) {
      uint64_t* row = &crossed_[static_cast<uint32_t>(slice) * stride[axis] + i * stride[across[0]]];
      for (uint32_t j = begin[1]; j < end[1]; ++j) row[j * stride[across[1]]] += rays;
    }
  }
}

Trace TraceRecorder::finish(std::span<const Vec3> probes) {
  LL_CHECK((probes.size() + 63) / 64 == words_);
  uint64_t rays = 0, skies = 0;
  // Places of one box by different origins are asked about together.
  absl::flat_hash_map<uint64_t, Place> first_of;
  for (Place i = 0; i < places_.size(); ++i) {
    const Seen& seen = places_[i];
    rays += seen.rays;
    const Aabb& origin = origins_[seen.origin];
    const Aabb box = box_of(seen, 0);
    if ((seen.where & kSky) != 0) {
      skies += seen.rays;
      draw(origin, {origin.lo + box.lo, origin.hi + box.hi}, seen.rays);
    } else {
      draw(origin, box, seen.rays);
    }
    const auto [known, is_new] = first_of.try_emplace(seen.where, i);
    if (is_new) continue;
    Seen& first = places_[known->second];
    first.rays += seen.rays;
    first.reach = std::max(first.reach, seen.reach);
    for (size_t w = 0; w < words_; ++w) asked_[known->second * words_ + w] |= asked_[i * words_ + w];
  }
  for (Place i = 0; i < places_.size(); ++i) {
    const Seen& seen = places_[i];
    if (first_of.at(seen.where) != i) continue;
    const bool sky = (seen.where & kSky) != 0;
    const Aabb box = box_of(seen, seen.reach);
    if (!sky && seen.reach > 0) draw(box, box, 1);
    for (size_t w = 0; w < words_; ++w) {
      for (uint64_t bits = asked_[i * words_ + w]; bits != 0; bits &= bits - 1) {
        const Vec3 p = probes[64 * w + static_cast<size_t>(std::countr_zero(bits))];
        const Aabb to = sky ? Aabb{p + box.lo, p + box.hi} : box;
        draw({p, p}, to, std::max(1u, seen.rays / kAskedPart));
      }
    }
  }
  Trace trace;
  trace.grid = grid_;
  // Not only rays to the sky leave the grid: probes may stand outside, and searches reach out.
  trace.sky = std::max<uint8_t>(stored_share(skies, rays), left_grid_ ? 1 : 0);
  std::vector<uint8_t> shares;
  shares.reserve(crossed_.size());
  for (const uint64_t count : crossed_) shares.push_back(stored_share(count, rays));
  trace.runs = pack_runs(shares);
  return trace;
}

}  // namespace lightloom
