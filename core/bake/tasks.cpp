#include "core/bake/tasks.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "core/base/stopwatch.h"
#include "core/base/version.h"
#include "core/compression/average.h"
#include "core/compression/clusters.h"
#include "core/probes/links.h"
#include "core/receivers/texel_opening.h"
#include "core/trace/trace_recorder.h"

namespace lightloom {
namespace {

ChunkObject chunk_object(const Plan& plan, const Scene& scene, uint32_t object) {
  const LightmapUv& uv = plan.layout.uv[object];
  return {scene.objects[object].id, static_cast<uint32_t>(uv.width), static_cast<uint32_t>(uv.height)};
}

/// Numbers things in the order in which their ids sort, so that a chunk's tables do not depend on the scene's order.
template <class Id>
std::map<Id, uint32_t> enumerate(std::vector<Id> ids) {
  std::sort(ids.begin(), ids.end());
  std::map<Id, uint32_t> slots;
  for (const Id& id : ids) slots.try_emplace(id, static_cast<uint32_t>(slots.size()));
  return slots;
}

/// Probes that each of the cell's receivers can read, nearest first, and all of them by their index in the plan, which is
/// the order of their keys.
struct Reach {
  std::vector<std::vector<ProbeGrid::Near>> near;
  std::map<uint32_t, uint32_t> slots;
};

Reach reach_of(const Plan& plan, const PlannedCell& cell) {
  Reach out;
  const ProbeGrid grid(plan.placement.probes, plan.params.spacing);
  const bool sl17 = plan.params.method == BakeMethod::kSl17;
  std::vector<uint32_t> reachable;
  for (const uint32_t r : cell.receivers) {
    const Vec3 x = plan.receivers.all[r].point.position;
    out.near.push_back(sl17 ? grid.within(x, plan.placement.radius) : grid.nearest(x, plan.params.links + kFallbacks));
    for (const auto& n : out.near.back()) reachable.push_back(n.probe);
  }
  out.slots = enumerate(std::move(reachable));
  return out;
}

/// Which receivers read which probe follows from where both are; where their rays start, from their objects.
Digest key_of(const Plan& plan, const Scene& scene, const PlannedCell& cell, const Reach& reach) {
  Hasher h;
  h.string("cell").string(kMethodVersion).bytes(&plan.params, sizeof plan.params);
  h.value(plan.layout.mode).value(plan.placement.radius).value(cell.level).bytes(&cell.cell, sizeof cell.cell);
  h.value(static_cast<uint64_t>(cell.receivers.size()));
  uint32_t object = 0xffffffffu;
  for (const uint32_t i : cell.receivers) {
    const Receiver& r = plan.receivers.all[i];
    if (r.object != object) {
      object = r.object;
      const LightmapUv& uv = plan.layout.uv[object];
      h.digest(scene.objects[object].id).value(scene.objects[object].texel_scale).value(uv.width).value(uv.height);
    }
    const struct {
      uint32_t key, parts;
      Vec3 position;
    } receiver{r.key, r.parts, r.point.position};
    h.bytes(&receiver, sizeof receiver);
  }
  for (const auto& [index, slot] : reach.slots) {
    const Probe& p = plan.placement.probes[index];
    h.bytes(&p.cell, sizeof p.cell).value(p.slot).bytes(&p.position, sizeof p.position);
  }
  return h.finish();
}

/// Where the texels of each object begin in a chunk's numbering: those of `objects` in turn, then `others` that are not among
/// them, which are appended.
std::map<uint32_t, uint32_t> number_texels(const Plan& plan, const Scene& scene, std::map<Digest, uint32_t> others,
                                           std::vector<ChunkObject>* objects) {
  std::map<uint32_t, uint32_t> base_of;
  uint32_t end = 0;
  for (const ChunkObject& known : *objects) {
    if (const auto it = others.find(known.id); it != others.end()) {
      base_of[it->second] = end;
      others.erase(it);
    }
    end += 2 * known.width * known.height;
  }
  for (const auto& [id, o] : others) {
    base_of[o] = end;
    objects->push_back(chunk_object(plan, scene, o));
    end += 2 * objects->back().width * objects->back().height;
  }
  return base_of;
}

/// Names the near texels of each receiver, in the order of the chunk's. Objects that the chunk does not know yet follow those it
/// knows.
void add_near_fields(const Plan& plan, const Scene& scene, int rays, std::span<const uint32_t> order,
                     const std::vector<std::vector<NearTexel>>& near, CellResult* out) {
  CellChunk* chunk = &out->chunk;
  std::map<Digest, uint32_t> object_of;
  std::map<uint32_t, std::set<uint32_t>> keys_of;
  for (const auto& of_receiver : near) {
    for (const NearTexel& n : of_receiver) {
      const Receiver& texel = plan.receivers.all[n.receiver];
      object_of.try_emplace(scene.objects[texel.object].id, texel.object);
      keys_of[texel.object].insert(texel.key);
    }
  }
  for (const auto& [id, o] : object_of) {
    const auto& keys = keys_of.at(o);
    out->near.push_back({chunk_object(plan, scene, o), {keys.begin(), keys.end()}});
  }
  const auto base_of = number_texels(plan, scene, std::move(object_of), &chunk->objects);

  constexpr size_t kMost = 65535;                     // that a count can say
  std::vector<std::pair<uint32_t, uint32_t>> texels;  // and rays: by name, as the scene's order must not show
  for (const uint32_t r : order) {
    texels.clear();
    for (const NearTexel& n : near[r]) {
      const Receiver& texel = plan.receivers.all[n.receiver];
      texels.emplace_back(base_of.at(texel.object) + texel.key, n.rays);
    }
    std::sort(texels.begin(), texels.end());
    texels.resize(std::min(texels.size(), kMost));
    chunk->near_counts.push_back(static_cast<uint16_t>(texels.size()));
    for (const auto& [texel, hits] : texels) {
      chunk->near_texels.push_back(texel);
      chunk->near_weights.push_back(static_cast<uint16_t>(std::lround(65535.0 * hits / rays)));
    }
  }
}

}  // namespace

Digest cell_key(const Plan& plan, const Scene& scene, const PlannedCell& cell) {
  return key_of(plan, scene, cell, reach_of(plan, cell));
}

Digest relight_key(const Plan& plan, const Probe& probe) {
  Hasher h;
  h.string("relight").string(kMethodVersion).value(plan.params.relight_rays);
  h.value(plan.layout.mode).value(plan.layout.texels_per_metre);
  h.bytes(&probe.cell, sizeof probe.cell).value(probe.slot).bytes(&probe.position, sizeof probe.position);
  return h.finish();
}

CellTask make_cell_task(const Plan& plan, const Scene& scene, const PlannedCell& cell) {
  CellTask task;
  task.grid = plan.grid;
  task.params = plan.params;
  task.seed = hash_combine(plan.params.seed, static_cast<uint64_t>(static_cast<uint32_t>(cell.level)));
  for (const int32_t i : cell.cell)
    task.seed = hash_combine(task.seed, static_cast<uint64_t>(static_cast<uint32_t>(i)));

  // Objects by id.
  std::map<Digest, uint32_t> object_of;
  for (const uint32_t r : cell.receivers) {
    const uint32_t o = plan.receivers.all[r].object;
    object_of.try_emplace(scene.objects[o].id, o);
  }
  std::map<uint32_t, uint32_t> slot_of;
  for (const auto& [id, o] : object_of) {
    slot_of[o] = static_cast<uint32_t>(task.objects.size());
    task.objects.push_back(chunk_object(plan, scene, o));
  }

  // Probes in the plan's order, which is that of their keys.
  const auto& probes = plan.placement.probes;
  const bool sl17 = plan.params.method == BakeMethod::kSl17;
  const Reach reach = reach_of(plan, cell);
  const auto& [near, probe_slot] = reach;
  task.key = key_of(plan, scene, cell, reach);
  for (const auto& [id, slot] : probe_slot) {
    task.probe_ids.push_back(id);
    task.probes.push_back(probes[id].position);
  }

  for (size_t i = 0; i < cell.receivers.size(); ++i) {
    const Receiver& r = plan.receivers.all[cell.receivers[i]];
    GatherPoint point;
    point.point = r.point;
    if (sl17) {
      point.from = {r.point};
    } else {
      const TexelGrid& grid = plan.receivers.grids[r.object];
      point.from =
          texel_points(scene.objects[r.object], plan.layout.uv[r.object], grid, grid.texels[r.texel], r.back, r.parts);
    }
    point.seed = hash_combine(r.seed, plan.params.seed);
    for (const auto& n : near[i]) point.near.push_back(probe_slot.at(n.probe));
    // SL17: one radius for all. Else the k nearest, and the distance to the next one: local, and continuous in x.
    const size_t k = static_cast<size_t>(plan.params.links);
    point.links = static_cast<uint32_t>(sl17 ? near[i].size() : std::min(near[i].size(), k));
    point.radius = sl17 ? plan.placement.radius : near[i].size() > k ? std::sqrt(near[i][k].distance2) : 0.0f;
    task.receivers.push_back(std::move(point));
    if (plan.params.average > 0) {
      const uint32_t triangle = plan.receivers.grids[r.object].texels[r.texel].triangle;
      task.sigma.push_back(plan.params.average *
                           texel_size(scene.objects[r.object], plan.layout.uv[r.object], triangle));
    }
    task.texels.push_back({slot_of.at(r.object), r.key});
  }
  return task;
}

absl::StatusOr<CellResult> bake_cell(const RayTracer& tracer, const Plan& plan, const ReceiverSearch& surfaces,
                                     VisibilityCache* cache, const CellTask& task, const CancelFlag* cancel) {
  const int J = sh_count(task.params.order);
  const bool sl17 = task.params.method == BakeMethod::kSl17;
  CellResult out;

  // Transport: one row α_x per receiver.
  const Stopwatch transport_watch;
  Matrix transport =
      Matrix::Zero(static_cast<Eigen::Index>(task.receivers.size()), static_cast<Eigen::Index>(task.probes.size()) * J);
  std::vector<Vec3> positions, normals;
  TraceRecorder recorder(task.grid, task.probes.size());
  Gatherer gatherer(tracer, cache, &surfaces, {task.probes, task.probe_ids},
                    {task.params.order, task.params.rays, !sl17, task.params.near_field}, &recorder);
  std::vector<std::vector<NearTexel>> near;
  for (size_t r = 0; r < task.receivers.size(); ++r) {
    if (cancel != nullptr && cancel->cancelled()) return absl::CancelledError("bake of a cell cancelled");
    const std::span<float> row(transport.row(static_cast<Eigen::Index>(r)).data(),
                               static_cast<size_t>(transport.cols()));
    out.stats += gatherer.add_row(task.receivers[r], row);
    near.emplace_back(gatherer.near().begin(), gatherer.near().end());
    positions.push_back(task.receivers[r].point.position);
    normals.push_back(task.receivers[r].point.normal);
    out.bounds.extend(positions.back());
  }
  out.trace = recorder.finish(task.probes);
  out.transport_seconds = transport_watch.seconds();

  // Compression.
  const Stopwatch compress_watch;
  CompressionOptions options;
  options.order = task.params.order;
  options.max_rank = task.params.max_rank;
  options.threshold = task.params.threshold;
  options.weigh_bands = !sl17;
  if (sl17) options.probe_loss = 0;
  options.relight_rays = static_cast<uint32_t>(task.params.relight_rays);
  options.seed = task.seed;
  const bool average = !task.sigma.empty();
  const Matrix averaged = average ? average_with_neighbours(transport, positions, normals, task.sigma) : Matrix();
  CompressedCell compressed = compress_cell(transport, average ? averaged : transport, positions, options);
  out.error = compressed.error;

  // Keep the probes that are read.
  std::vector<uint32_t> used;
  for (const auto& cluster : compressed.clusters) used.insert(used.end(), cluster.probes.begin(), cluster.probes.end());
  const auto slot = enumerate(std::move(used));
  for (const auto& [probe, unused] : slot) out.probe_ids.push_back(task.probe_ids[probe]);
  for (auto& cluster : compressed.clusters) {
    for (uint32_t& p : cluster.probes) p = slot.at(p);
  }

  out.chunk.order = static_cast<uint32_t>(task.params.order);
  out.chunk.probe_count = static_cast<uint32_t>(out.probe_ids.size());
  out.chunk.objects = task.objects;
  for (const uint32_t r : compressed.order) out.chunk.receivers.push_back(task.texels[r]);
  out.chunk.uniform = std::move(compressed.uniform);
  out.chunk.clusters = std::move(compressed.clusters);
  add_near_fields(plan, tracer.scene(), task.params.rays, compressed.order, near, &out);
  out.compress_seconds = compress_watch.seconds();
  return out;
}

RelightResult bake_relight(const RayTracer& tracer, const Plan& plan, const ReceiverSearch& receivers, Vec3 probe) {
  const Scene& scene = tracer.scene();
  const uint32_t n = static_cast<uint32_t>(plan.params.relight_rays);
  RelightChunk out;
  out.position = probe;
  TraceRecorder recorder(plan.grid, 0);
  recorder.from({probe, probe});

  // Texel per ray, then numbered by the objects that were hit.
  std::vector<uint32_t> receiver(n, Receivers::kNone);
  out.rays.assign(n, RelightChunk::kDead);
  std::map<Digest, uint32_t> object_of;
  for (uint32_t i = 0; i < n; ++i) {
    const Vec3 direction = sphere_direction(i, n);
    const Hit hit = tracer.closest(probe, direction);
    if (!hit) {
      out.rays[i] = RelightChunk::kSky;
      recorder.sky(direction);
      continue;
    }
    float reach = 0;
    if (!is_dark_back(scene, hit)) receiver[i] = receivers.locate(hit, &reach);
    recorder.hit(tracer.position(hit), reach);
    if (receiver[i] == Receivers::kNone) continue;
    const uint32_t o = plan.receivers.all[receiver[i]].object;
    object_of.try_emplace(scene.objects[o].id, o);
  }
  const auto base_of = number_texels(plan, scene, std::move(object_of), &out.objects);
  for (uint32_t i = 0; i < n; ++i) {
    if (receiver[i] == Receivers::kNone) continue;
    const Receiver& r = plan.receivers.all[receiver[i]];
    out.rays[i] = base_of.at(r.object) + r.key;
  }
  return {std::move(out), recorder.finish({})};
}

SurfaceChunk make_surface(const Plan& plan, const Scene& scene, uint32_t object) {
  SurfaceChunk out;
  out.object = chunk_object(plan, scene, object);
  for (uint32_t i = plan.receivers.ranges[object].begin; i < plan.receivers.ranges[object].end; ++i) {
    const Receiver& r = plan.receivers.all[i];
    const Texel& texel = plan.receivers.grids[object].texels[r.texel];
    out.keys.push_back(r.key);
    out.positions.push_back(interpolate(scene.objects[object].positions,
                                        scene.objects[object].triangles[texel.triangle], texel.b1, texel.b2));
    out.normals.push_back(r.point.normal);
    out.areas.push_back(texel.area);
  }
  return out;
}

}  // namespace lightloom
