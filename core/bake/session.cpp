#include "core/bake/session.h"

#include <string>
#include <string_view>

#include "core/bake/assemble.h"
#include "core/bake/tasks.h"
#include "core/base/stopwatch.h"
#include "core/base/version.h"

namespace lightloom {
namespace {

/// Of all that tasks read from the plan: workers whose plans differ must not work on the same bake.
Digest hash_plan(const Plan& plan, const Scene& scene) {
  Hasher h;
  h.string("plan").string(kMethodVersion).digest(scene_hash(scene)).bytes(&plan.params, sizeof plan.params);
  h.value(plan.layout.mode).value(plan.layout.width).value(plan.layout.height);
  for (size_t o = 0; o < scene.objects.size(); ++o) {
    const LightmapUv& uv = plan.layout.uv[o];
    h.string(scene.objects[o].name).digest(scene.objects[o].id).value(uv.width).value(uv.height);
    h.value(plan.layout.placements[o].x).value(plan.layout.placements[o].y);
  }
  for (const Receiver& r : plan.receivers.all) {
    const struct {
      uint32_t object, key, parts;
      Vec3 position;
    } receiver{r.object, r.key, r.parts, r.point.position};
    h.bytes(&receiver, sizeof receiver);
  }
  for (const Probe& p : plan.placement.probes) {
    h.bytes(&p.cell, sizeof p.cell).value(p.slot).bytes(&p.position, sizeof p.position);
  }
  for (const PlannedCell& c : plan.cells) h.value(c.level).bytes(&c.cell, sizeof c.cell).array(c.receivers);
  return h.finish();
}

absl::Status not_planned(std::string_view what, size_t index, size_t planned) {
  return absl::OutOfRangeError("there is no " + std::string(what) + " " + std::to_string(index) + ": the plan has " +
                               std::to_string(planned) + "; run the tasks that the plan asks for");
}

CellRecord make_record(const Plan& plan, const CellTask& task, const CellResult& c, const ChunkRef& chunk) {
  CellRecord record;
  record.key = task.key;
  record.near = c.near;
  record.trace = c.trace;
  record.chunk = chunk;
  record.bounds = c.bounds;
  record.gather_rays = c.stats.gather_rays;
  record.unseen = c.stats.unseen;
  record.error = c.error;
  for (const uint32_t p : c.probe_ids) record.probes.push_back(plan.placement.probes[p].name());
  for (const CellChunk::Cluster& k : c.chunk.clusters) {
    record.clusters.push_back({k.bounds, k.receivers, k.rank(), static_cast<uint32_t>(k.probes.size()), k.error});
    record.coefficients += static_cast<uint64_t>(k.rank()) * k.receivers;
    record.bytes_projection += k.projection.size() * sizeof(Half) + k.correction.size() * sizeof(float);
    record.bytes_reconstruction += k.reconstruction.size() * sizeof(Half);
  }
  record.bytes_reconstruction += c.chunk.uniform.size() * sizeof(uint16_t);
  return record;
}

template <class T>
uint64_t bytes_of(const std::vector<T>& v) {
  return v.size() * sizeof(T);
}

/// Of what is big: the rest is small beside it, or short-lived.
uint64_t bytes_of(const RayTracer& tracer, const Plan& plan) {
  uint64_t bytes = tracer.bytes();
  for (const Object& o : tracer.scene().objects) {
    bytes += bytes_of(o.positions) + bytes_of(o.normals) + bytes_of(o.uv0) + bytes_of(o.uv1) + bytes_of(o.triangles);
  }
  for (const Texture& t : tracer.scene().textures) bytes += bytes_of(t.rgba);
  for (const LightmapUv& uv : plan.layout.uv) bytes += bytes_of(uv.corners);
  for (const TexelGrid& grid : plan.receivers.grids) bytes += bytes_of(grid.texels) + bytes_of(grid.fragments);
  for (const PlannedCell& cell : plan.cells) bytes += bytes_of(cell.receivers);
  return bytes + bytes_of(plan.receivers.all) + bytes_of(plan.placement.probes);
}

}  // namespace

BakeSession::BakeSession(const RayTracer& tracer, Plan plan)
    : tracer_(tracer),
      plan_(std::move(plan)),
      plan_digest_(hash_plan(plan_, tracer.scene())),
      probes_(positions_of(plan_.placement.probes)),
      search_(tracer, plan_.layout, plan_.receivers),
      bytes_(bytes_of(tracer, plan_)) {
  if (plan_.params.method == BakeMethod::kSl17) return;
  cache_ = std::make_unique<VisibilityCache>(tracer, plan_.layout, plan_.receivers.grids, probes_);
}

absl::StatusOr<std::unique_ptr<BakeSession>> BakeSession::create(const RayTracer& tracer, const BakeParams& params,
                                                                 const BakeControl& control) {
  LL_ASSIGN_OR_RETURN(Plan plan, make_plan(tracer, params, control));
  return std::unique_ptr<BakeSession>(new BakeSession(tracer, std::move(plan)));
}

absl::StatusOr<std::unique_ptr<BakeSession>> BakeSession::create(Scene scene, const BakeParams& params,
                                                                 const BakeControl& control) {
  Owned owned;
  owned.scene = std::make_unique<const Scene>(std::move(scene));
  LL_ASSIGN_OR_RETURN(owned.tracer, RayTracer::create(*owned.scene));
  LL_ASSIGN_OR_RETURN(auto session, create(*owned.tracer, params, control));
  session->owned_ = std::move(owned);
  return session;
}

absl::StatusOr<BakedCell> BakeSession::cell(size_t index, const ChunkSink& sink, const CancelFlag* cancel) const {
  if (index >= plan_.cells.size()) return not_planned("cell", index, plan_.cells.size());
  const CellTask task = make_cell_task(plan_, scene(), plan_.cells[index]);
  LL_ASSIGN_OR_RETURN(const CellResult result, bake_cell(tracer_, plan_, search_, cache_.get(), task, cancel));
  {
    const std::lock_guard lock(mutex_);
    spent_.gather_rays += result.stats.gather_rays;
    spent_.visibility_rays += result.stats.visibility_rays;
    spent_.transport_seconds += result.transport_seconds;
    spent_.compress_seconds += result.compress_seconds;
  }
  LL_ASSIGN_OR_RETURN(const ChunkRef chunk, sink(encode_cell(result.chunk)));
  return BakedCell{make_record(plan_, task, result, chunk), result.stats.visibility_rays};
}

absl::StatusOr<std::vector<RelightRecord>> BakeSession::relight(size_t first, size_t count, const ChunkSink& sink,
                                                                const CancelFlag* cancel) const {
  const auto& probes = plan_.placement.probes;
  if (first > probes.size() || count > probes.size() - first) {
    return not_planned("probe", first + count - 1, probes.size());
  }
  std::vector<RelightRecord> records;
  const Stopwatch watch;
  for (size_t i = first; i < first + count; ++i) {
    if (cancel != nullptr && cancel->cancelled()) return absl::CancelledError("relight rays cancelled");
    RelightResult result = bake_relight(tracer_, plan_, search_, probes[i].position);
    LL_ASSIGN_OR_RETURN(const ChunkRef chunk, sink(encode_relight(result.chunk)));
    records.push_back({probes[i].name(), relight_key(plan_, probes[i]), chunk, std::move(result.trace)});
  }
  const std::lock_guard lock(mutex_);
  spent_.relight_seconds += watch.seconds();
  return records;
}

uint64_t BakeSession::bytes() const { return bytes_ + (cache_ != nullptr ? cache_->bytes() : 0); }

BakeSession::Spent BakeSession::spent() const {
  const std::lock_guard lock(mutex_);
  return spent_;
}

absl::StatusOr<ChunkRef> BakeSession::surface(size_t object, const ChunkSink& sink) const {
  if (object >= scene().objects.size()) return not_planned("object", object, scene().objects.size());
  if (plan_.layout.uv[object].corners.empty()) return ChunkRef{};
  const SurfaceChunk surface = make_surface(plan_, scene(), static_cast<uint32_t>(object));
  if (surface.keys.empty()) return ChunkRef{};
  return sink(encode_surface(surface));
}

const WorldContents& BakeSession::world() const {
  std::call_once(world_known_, [&] { world_ = contents_of(scene(), plan_.layout, plan_.receivers, plan_.grid); });
  return world_;
}

absl::StatusOr<std::shared_ptr<const Reuse>> BakeSession::reuse(const EarlierResults& earlier,
                                                                const std::function<absl::StatusOr<BakeTraces>()>& load,
                                                                const Parallel& parallel) const {
  {
    const std::lock_guard lock(mutex_);
    if (reuse_.second != nullptr && reuse_.first == earlier) return reuse_.second;
  }
  LL_ASSIGN_OR_RETURN(const BakeTraces traces, load());
  LL_ASSIGN_OR_RETURN(Reuse found, find_reuse(plan_, scene(), world(), traces, earlier.tolerance, parallel));
  const std::lock_guard lock(mutex_);
  reuse_ = {earlier, std::make_shared<const Reuse>(std::move(found))};
  return reuse_.second;
}

absl::StatusOr<BakeSession::Finished> BakeSession::finish(std::vector<CellRecord> cells,
                                                          std::vector<RelightRecord> relight,
                                                          const std::vector<ChunkRef>& surfaces) const {
  std::vector<ChunkRef> relight_chunks;
  for (const RelightRecord& r : relight) relight_chunks.push_back(r.chunk);
  Finished out;
  LL_ASSIGN_OR_RETURN(out.manifest, assemble(plan_, scene(), cells, relight_chunks, surfaces));

  // Of the probes, those that are in the asset: the chunks of others may be gone when they are wanted.
  LL_ASSIGN_OR_RETURN(const std::vector<uint32_t> used, used_probes(plan_, cells));
  out.traces = {world(), std::move(cells), {}};
  for (const uint32_t p : used) out.traces.probes.push_back(std::move(relight[p]));
  return out;
}

}  // namespace lightloom
