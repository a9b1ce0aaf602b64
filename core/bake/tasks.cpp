#include "core/bake/tasks.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "core/base/stopwatch.h"
#include "core/compression/clusters.h"
#include "core/probes/links.h"
#include "core/receivers/texel_opening.h"

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

}  // namespace

CellTask make_cell_task(const Plan& plan, const Scene& scene, const PlannedCell& cell) {
  CellTask task;
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
  const ProbeGrid grid(probes, plan.params.spacing);
  std::vector<std::vector<ProbeGrid::Near>> near(cell.receivers.size());
  std::vector<uint32_t> reachable;
  const bool sl17 = plan.params.method == BakeMethod::kSl17;
  for (size_t i = 0; i < cell.receivers.size(); ++i) {
    const Vec3 x = plan.receivers.all[cell.receivers[i]].point.position;
    near[i] = sl17 ? grid.within(x, plan.placement.radius) : grid.nearest(x, plan.params.links + kFallbacks);
    for (const auto& n : near[i]) reachable.push_back(n.probe);
  }
  const auto probe_slot = enumerate(std::move(reachable));
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
    task.texels.push_back({slot_of.at(r.object), r.key});
  }
  return task;
}

absl::StatusOr<CellResult> bake_cell(const RayTracer& tracer, VisibilityCache* cache, const CellTask& task,
                                     const CancelFlag* cancel) {
  const int J = sh_count(task.params.order);
  const bool sl17 = task.params.method == BakeMethod::kSl17;
  CellResult out;

  // Transport: one row α_x per receiver.
  const Stopwatch transport_watch;
  Matrix transport =
      Matrix::Zero(static_cast<Eigen::Index>(task.receivers.size()), static_cast<Eigen::Index>(task.probes.size()) * J);
  std::vector<Vec3> positions;
  Gatherer gatherer(tracer, cache, {task.probes, task.probe_ids}, {task.params.order, task.params.rays, !sl17});
  for (size_t r = 0; r < task.receivers.size(); ++r) {
    if (cancel != nullptr && cancel->cancelled()) return absl::CancelledError("bake of a cell cancelled");
    const std::span<float> row(transport.row(static_cast<Eigen::Index>(r)).data(),
                               static_cast<size_t>(transport.cols()));
    out.stats += gatherer.add_row(task.receivers[r], row);
    positions.push_back(task.receivers[r].point.position);
    out.bounds.extend(positions.back());
  }
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
  CompressedCell compressed = compress_cell(transport, positions, options);
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
  out.compress_seconds = compress_watch.seconds();
  return out;
}

RelightChunk bake_relight(const RayTracer& tracer, const Plan& plan, const ReceiverSearch& receivers, Vec3 probe) {
  const Scene& scene = tracer.scene();
  const uint32_t n = static_cast<uint32_t>(plan.params.relight_rays);
  RelightChunk out;
  out.position = probe;

  // Texel per ray, then numbered by the objects that were hit.
  std::vector<uint32_t> receiver(n, Receivers::kNone);
  out.rays.assign(n, RelightChunk::kDead);
  std::map<Digest, uint32_t> object_of;
  for (uint32_t i = 0; i < n; ++i) {
    const Hit hit = tracer.closest(probe, sphere_direction(i, n));
    if (!hit) {
      out.rays[i] = RelightChunk::kSky;
      continue;
    }
    const Object& object = scene.objects[hit.object];
    if (hit.back && !scene.materials[object.triangles[hit.triangle].material].double_sided) continue;
    receiver[i] = receivers.locate(hit);
    if (receiver[i] == Receivers::kNone) continue;
    const uint32_t o = plan.receivers.all[receiver[i]].object;
    object_of.try_emplace(scene.objects[o].id, o);
  }
  std::map<uint32_t, uint32_t> base_of;
  uint32_t base = 0;
  for (const auto& [id, o] : object_of) {
    base_of[o] = base;
    out.objects.push_back(chunk_object(plan, scene, o));
    base += 2 * out.objects.back().width * out.objects.back().height;
  }
  for (uint32_t i = 0; i < n; ++i) {
    if (receiver[i] == Receivers::kNone) continue;
    const Receiver& r = plan.receivers.all[receiver[i]];
    out.rays[i] = base_of.at(r.object) + r.key;
  }
  return out;
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
