#include "core/receivers/receivers.h"

#include <algorithm>
#include <array>

#include "core/receivers/open_space.h"
#include "core/receivers/texel_opening.h"

namespace lightloom {

void Receivers::retain(const std::vector<bool>& keep) {
  std::vector<Receiver> kept;
  for (Range& range : ranges) {
    const uint32_t begin = static_cast<uint32_t>(kept.size());
    for (uint32_t i = range.begin; i < range.end; ++i) {
      if (keep[i]) kept.push_back(all[i]);
    }
    range = {begin, static_cast<uint32_t>(kept.size())};
  }
  all = std::move(kept);
}

uint32_t Receivers::find(uint32_t object, uint32_t key) const {
  const auto begin = all.begin() + ranges[object].begin, end = all.begin() + ranges[object].end;
  const auto it = std::lower_bound(begin, end, key, [](const Receiver& r, uint32_t k) { return r.key < k; });
  return it != end && it->key == key ? static_cast<uint32_t>(it - all.begin()) : kNone;
}

absl::StatusOr<Receivers> find_receivers(const RayTracer& tracer, const AtlasLayout& layout, const Parallel& parallel) {
  const Scene& scene = tracer.scene();
  Receivers out;
  out.grids.resize(scene.objects.size());
  struct Item {
    uint32_t object, texel;
  };
  std::vector<Item> items;
  for (uint32_t o = 0; o < scene.objects.size(); ++o) {
    if (layout.uv[o].corners.empty()) continue;
    out.grids[o] = rasterise(scene.objects[o], layout.uv[o]);
    for (uint32_t t = 0; t < out.grids[o].texels.size(); ++t) items.push_back({o, t});
  }

  struct Sides {
    std::array<Receiver, 2> receiver;
    std::array<Space, 2> space{Space::kVoid, Space::kVoid};
  };
  std::vector<Sides> sides(items.size());
  const bool done = parallel_for(items.size(), parallel, [&](uint64_t i) {
    const Object& object = scene.objects[items[i].object];
    const TexelGrid& grid = out.grids[items[i].object];
    const Texel& texel = grid.texels[items[i].texel];
    const bool double_sided = scene.materials[object.triangles[texel.triangle].material].double_sided;
    for (uint32_t side = 0; side < (double_sided ? 2u : 1u); ++side) {
      Receiver& r = sides[i].receiver[side];
      r.object = items[i].object;
      r.texel = items[i].texel;
      r.back = side == 1;
      r.key = (side * static_cast<uint32_t>(grid.height) + texel.y) * static_cast<uint32_t>(grid.width) + texel.x;
      r.seed = receiver_seed(object, r.key);
      const TexelOpening opening(tracer, object, layout.uv[r.object], grid, texel, r.back, r.seed);
      r.point = opening.middle();
      r.parts = opening.parts();
      sides[i].space[side] = classify(tracer, r.point, r.seed);
    }
  });
  if (!done) return absl::CancelledError("cancelled while finding receivers");

  out.ranges.resize(scene.objects.size());
  size_t i = 0;
  for (uint32_t o = 0; o < scene.objects.size(); ++o) {
    out.ranges[o].begin = static_cast<uint32_t>(out.all.size());
    const size_t begin = i;
    while (i < items.size() && items[i].object == o) ++i;
    for (size_t side = 0; side < 2; ++side) {
      for (size_t k = begin; k < i; ++k) {
        const Space space = sides[k].space[side];
        if (space == Space::kOpen || (side == 0 && space == Space::kVoid)) out.all.push_back(sides[k].receiver[side]);
        if (side == 0 && space == Space::kSolid) ++out.solid_texels;
      }
    }
    out.ranges[o].end = static_cast<uint32_t>(out.all.size());
  }
  return out;
}

}  // namespace lightloom
