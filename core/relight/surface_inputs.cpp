#include "core/relight/surface_inputs.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/asset/asset.h"
#include "core/bake/plan.h"
#include "core/base/sampling.h"
#include "core/base/text.h"
#include "core/receivers/texel_opening.h"
#include "core/reference/path_tracer.h"

namespace lightloom {
namespace {

absl::Status stale(const std::string& why) {
  return absl::FailedPreconditionError("the asset was not baked from this scene (" + why + "); bake again");
}

/// Index of the texel at (x, y), or texels.size(). Texels are in row order.
size_t find_texel(const TexelGrid& grid, uint32_t x, uint32_t y) {
  const auto it = std::lower_bound(grid.texels.begin(), grid.texels.end(), std::pair(y, x),
                                   [](const Texel& t, const auto& key) { return std::pair(t.y, t.x) < key; });
  return it != grid.texels.end() && it->x == x && it->y == y ? static_cast<size_t>(it - grid.texels.begin())
                                                             : grid.texels.size();
}

}  // namespace

absl::StatusOr<SurfaceElements> load_surface_elements(const std::filesystem::path& loom, const Manifest& manifest,
                                                      const Scene& scene) {
  if (scene_hash(scene) != manifest.scene_hash) return stale("its geometry differs");
  LayoutOptions options;
  options.lightmap_size = manifest.params.lightmap_size;
  options.texels_per_metre = manifest.params.texels_per_metre;
  SurfaceElements out;
  LL_ASSIGN_OR_RETURN(out.layout, make_layout(scene, options));

  std::map<Digest, uint32_t> scene_object;
  for (uint32_t o = 0; o < scene.objects.size(); ++o) scene_object[scene.objects[o].id] = o;
  const ChunkStore store = chunk_store(loom);
  Receivers& receivers = out.receivers;
  receivers.grids.resize(scene.objects.size());
  receivers.ranges.resize(scene.objects.size());
  for (const ObjectEntry& entry : manifest.objects) {
    const auto it = scene_object.find(entry.id);
    if (it == scene_object.end()) return stale("object '" + printable(entry.name) + "' is missing");
    const uint32_t o = it->second;
    const LightmapUv& uv = out.layout.uv[o];
    if (uv.width != entry.width || uv.height != entry.height)
      return stale("the lightmap of '" + printable(entry.name) + "' differs");
    // The asset's placement is in force: an incremental bake keeps old places.
    out.layout.placements[o] = {entry.x, entry.y};
    receivers.ranges[o].begin = static_cast<uint32_t>(receivers.all.size());
    if (entry.surface.size > 0) {
      LL_ASSIGN_OR_RETURN(const auto bytes, store.get(entry.surface));
      LL_ASSIGN_OR_RETURN(const SurfaceChunk surface, decode_surface(bytes));
      receivers.grids[o] = rasterise(scene.objects[o], uv);
      const uint32_t width = static_cast<uint32_t>(uv.width), texels = width * static_cast<uint32_t>(uv.height);
      for (const uint32_t key : surface.keys) {
        Receiver r;
        r.object = o;
        r.key = key;
        r.back = key >= texels;
        const size_t texel = find_texel(receivers.grids[o], key % texels % width, key % texels / width);
        if (texel == receivers.grids[o].texels.size())
          return stale("the lightmap of '" + printable(entry.name) + "' differs");
        const Texel& t = receivers.grids[o].texels[texel];
        r.texel = static_cast<uint32_t>(texel);
        r.point = shading_point(scene.objects[o], t.triangle, t.b1, t.b2, r.back);
        r.seed = receiver_seed(scene.objects[o], key);
        receivers.all.push_back(r);
      }
    }
    receivers.ranges[o].end = static_cast<uint32_t>(receivers.all.size());
  }
  out.layout.width = manifest.width;
  out.layout.height = manifest.height;
  return out;
}

namespace {

absl::StatusOr<SurfaceInputs> sample_surfaces(const RayTracer& tracer, const SurfaceElements& elements, int samples,
                                              bool direct, const Parallel& parallel) {
  const Scene& scene = tracer.scene();
  const size_t n = elements.receivers.all.size();
  const uint32_t side = strata(samples);
  SurfaceInputs out;
  if (direct) out.direct.resize(n);
  out.albedo.resize(n);
  out.emission.resize(n);
  const bool done = parallel_for(n, parallel, [&](uint64_t i) {
    const Receiver& r = elements.receivers.all[i];
    const Object& object = scene.objects[r.object];
    const TexelGrid& grid = elements.receivers.grids[r.object];
    const Texel& texel = grid.texels[r.texel];
    const LightmapUv& uv = elements.layout.uv[r.object];
    const TexelOpening opening(tracer, object, uv, grid, texel, r.back, r.seed);
    const auto open = [&](const SurfacePoint& p) { return opening.contains(p); };
    Rng rng(hash_combine(r.seed, 0xd12ec7));
    const float weight = 1.0f / static_cast<float>(side * side);
    for (uint32_t s = 0; s < side * side; ++s) {
      const SurfacePoint p = sample_texel(object, uv, grid, texel, stratified(s, side, &rng), Footprint::kTexel, open);
      const Triangle& t = object.triangles[p.triangle];
      if (direct) {
        out.direct[i] += direct_irradiance(tracer, shading_point(object, p.triangle, p.b1, p.b2, r.back)) * weight;
      }
      out.albedo[i] += albedo_at(scene, object, t, p.b1, p.b2) * weight;
      if (!r.back) out.emission[i] += emission_at(scene, object, t, p.b1, p.b2) * weight;
    }
  });
  // A sum of rounded shares of white may exceed white.
  for (Vec3& a : out.albedo) a = {std::min(a.x, 1.0f), std::min(a.y, 1.0f), std::min(a.z, 1.0f)};
  if (!done) return absl::CancelledError("cancelled while lighting surfaces");
  return out;
}

}  // namespace

absl::StatusOr<SurfaceInputs> surface_materials(const RayTracer& tracer, const SurfaceElements& elements, int samples,
                                                const Parallel& parallel) {
  return sample_surfaces(tracer, elements, samples, /*direct=*/false, parallel);
}

absl::StatusOr<SurfaceInputs> light_surfaces(const RayTracer& tracer, const SurfaceElements& elements, int samples,
                                             const Parallel& parallel) {
  return sample_surfaces(tracer, elements, samples, /*direct=*/true, parallel);
}

}  // namespace lightloom
