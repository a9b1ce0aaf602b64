#include "core/trace/world_contents.h"

#include <bit>

#include "core/base/hash.h"
#include "core/base/overlap.h"
#include "core/base/rng.h"

namespace lightloom {
namespace {

/// Of the half of a cell: a triangle in the face between two cells is in both.
constexpr float kWider = 1.0f + 1.0f / 64;

/// Two streams from one digest.
class Mixer {
 public:
  explicit Mixer(const Digest& seed) {
    for (size_t i = 0; i < seed_.size(); ++i) {
      for (size_t b = 0; b < 8; ++b) seed_[i] |= uint64_t{seed.bytes[8 * i + b]} << (8 * b);
    }
  }
  ContentHash operator()(uint64_t item) const {
    return {{mix64(seed_[0] ^ mix64(item)), mix64(seed_[1] ^ mix64(item + 0x9e3779b97f4a7c15ull))}};
  }

 private:
  std::array<uint64_t, 2> seed_{};
};

/// What a hit on the object leads to: its triangles, and the texels that they are in.
Mixer mixer_of(const Object& object, const LightmapUv& uv) {
  Hasher h;
  h.string("object").digest(object.id).value(object.receive).value(object.texel_scale);
  h.value(uv.width).value(uv.height);
  return Mixer(h.finish());
}

}  // namespace

WorldContents contents_of(const Scene& scene, const AtlasLayout& layout, const Receivers& receivers,
                          const WorldGrid& grid) {
  std::vector<CellContents> all(grid.cells());
  const float side = static_cast<float>(grid.side());
  const auto add_triangle = [&](const std::array<Vec3, 3>& corners, const ContentHash& hash) {
    Aabb box;
    for (const Vec3 corner : corners) box.extend(corner);
    // More than cells are widened by.
    const Vec3 around = Vec3{side, side, side} * (kWider - 1);
    const GridCell lo = grid.nearest(box.lo - around), hi = grid.nearest(box.hi + around);
    GridCell c;
    for (c[0] = lo[0]; c[0] <= hi[0]; ++c[0]) {
      for (c[1] = lo[1]; c[1] <= hi[1]; ++c[1]) {
        for (c[2] = lo[2]; c[2] <= hi[2]; ++c[2]) {
          Vec3 middle;
          for (int a = 0; a < 3; ++a) {
            middle[a] = static_cast<float>((c[static_cast<size_t>(a)] + 0.5) * grid.side());
          }
          if (overlaps(corners[0] - middle, corners[1] - middle, corners[2] - middle, 0.5f * side * kWider)) {
            all[grid.index(c)].geometry.add(hash);
          }
        }
      }
    }
  };
  for (size_t o = 0; o < scene.objects.size(); ++o) {
    const Object& object = scene.objects[o];
    if (!object.is_static) continue;
    const Mixer mixer = mixer_of(object, layout.uv[o]);
    for (uint32_t t = 0; t < object.triangles.size(); ++t) {
      const auto& v = object.triangles[t].v;
      add_triangle({object.positions[v[0]], object.positions[v[1]], object.positions[v[2]]}, mixer(t));
    }
    for (uint32_t r = receivers.ranges[o].begin; r < receivers.ranges[o].end; ++r) {
      const Receiver& receiver = receivers.all[r];
      uint64_t item = uint64_t{receiver.parts} << 32 | receiver.key;
      for (int a = 0; a < 3; ++a) item = hash_combine(item, std::bit_cast<uint32_t>(receiver.point.position[a]));
      all[grid.index(grid.nearest(receiver.point.position))].receivers.add(mixer(item));
    }
  }
  WorldContents out;
  out.grid = grid;
  for (uint32_t i = 0; i < all.size(); ++i) {
    if (all[i] == CellContents{}) continue;
    out.cells.push_back(i);
    out.contents.push_back(all[i]);
  }
  return out;
}

}  // namespace lightloom
