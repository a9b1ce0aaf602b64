#include "core/bake/bake.h"

#include <atomic>
#include <mutex>
#include <optional>

#include "core/base/stopwatch.h"

namespace lightloom {
namespace {

/// Writes chunks from several threads and keeps the first error.
class ChunkWriter {
 public:
  explicit ChunkWriter(ChunkStore store) : store_(std::move(store)) {}

  ChunkRef put(std::span<const uint8_t> bytes) {
    const Stopwatch watch;
    auto ref = store_.put(bytes);
    const std::lock_guard lock(mutex_);
    seconds_ += watch.seconds();
    if (!ref.ok()) {
      if (status_.ok()) status_ = ref.status();
      failed_ = true;
      return {};
    }
    return *ref;
  }
  /// Of a put: further ones are not worth the work.
  bool failed() const { return failed_.load(std::memory_order_relaxed); }
  const absl::Status& status() const { return status_; }
  double seconds() const { return seconds_; }

 private:
  ChunkStore store_;
  std::mutex mutex_;
  std::atomic<bool> failed_{false};
  absl::Status status_;  // guarded by mutex_, like the next
  double seconds_ = 0;
};

absl::Status cancelled(const std::filesystem::path& loom) {
  std::error_code error;
  const bool old = std::filesystem::exists(loom / "manifest", error);
  return absl::CancelledError("bake cancelled; " + loom.string() +
                              (old ? " still holds the earlier bake, whole" : " holds no asset yet: bake again"));
}

void add_cell(const CellResult& c, BakeReport* report) {
  report->rays_gather += c.stats.gather_rays;
  report->rays_visibility += c.stats.visibility_rays;
  report->unseen += c.stats.unseen;
  report->clusters += c.chunk.clusters.size();
  for (const CellChunk::Cluster& k : c.chunk.clusters) {
    report->coefficients += static_cast<double>(k.rank()) * k.receivers;
    report->bytes_projection += k.projection.size() * sizeof(Half) + k.correction.size() * sizeof(float);
    report->bytes_reconstruction += k.reconstruction.size() * sizeof(Half);
  }
  report->bytes_reconstruction += c.chunk.uniform.size() * sizeof(uint16_t);
}

}  // namespace

absl::StatusOr<BakeReport> bake(const RayTracer& tracer, const BakeParams& params, const std::filesystem::path& loom,
                                const BakeControl& control) {
  const Stopwatch watch;
  const Scene& scene = tracer.scene();
  BakeReport report;
  LL_ASSIGN_OR_RETURN(const Plan plan, make_plan(tracer, params, control));
  report.seconds_plan = watch.seconds();
  report.seconds_receivers = plan.seconds_receivers;
  report.seconds_probes = plan.seconds_probes;
  report.receivers = plan.receivers.all.size();
  report.repairs = plan.placement.repairs;
  report.cells = plan.cells.size();

  ChunkWriter writer(chunk_store(loom));
  const Stopwatch cells_watch;
  std::vector<CellResult> cells(plan.cells.size());
  std::vector<ChunkRef> cell_refs(plan.cells.size());
  std::atomic<uint64_t> rays{0};
  std::vector<Vec3> probes;
  for (const Probe& p : plan.placement.probes) probes.push_back(p.position);
  std::optional<VisibilityCache> cache;
  if (params.method != BakeMethod::kSl17) cache.emplace(tracer, plan.layout, plan.receivers.grids, probes);
  Parallel cell_stage = control.stage("cells");
  if (control.progress) {
    cell_stage.progress = [&](uint64_t finished, uint64_t total) {
      control.progress("cells", finished, total, rays.load());
    };
  }
  bool done = parallel_for(cells.size(), cell_stage, [&](uint64_t i) {
    if (writer.failed()) return;
    cells[i] = bake_cell(tracer, cache ? &*cache : nullptr, make_cell_task(plan, tracer, plan.cells[i]));
    rays += cells[i].stats.gather_rays + cells[i].stats.visibility_rays;
    cell_refs[i] = writer.put(encode_cell(cells[i].chunk));
  });
  LL_RETURN_IF_ERROR(writer.status());
  if (!done) return cancelled(loom);
  double transport = 0, compress = 0;
  for (const CellResult& c : cells) {
    add_cell(c, &report);
    transport += c.transport_seconds;
    compress += c.compress_seconds;
  }
  // The threads' shares of the stage's wall time.
  const double cells_seconds = cells_watch.seconds();
  if (transport + compress > 0) {
    report.seconds_transport = cells_seconds * transport / (transport + compress);
    report.seconds_compress = cells_seconds - report.seconds_transport;
  }

  const std::vector<uint32_t> used = used_probes(cells);
  report.probes = used.size();
  const Stopwatch relight_watch;
  std::vector<ChunkRef> relight(used.size());
  const ReceiverSearch search(scene, plan.layout, plan.receivers);
  done = parallel_for(used.size(), control.stage("relight rays"), [&](uint64_t i) {
    if (writer.failed()) return;
    relight[i] =
        writer.put(encode_relight(bake_relight(tracer, plan, search, plan.placement.probes[used[i]].position)));
  });
  LL_RETURN_IF_ERROR(writer.status());
  if (!done) return cancelled(loom);
  report.seconds_relight = relight_watch.seconds();
  report.rays_relight = used.size() * static_cast<uint64_t>(plan.params.relight_rays);
  std::vector<ChunkRef> surfaces(scene.objects.size());
  for (uint32_t o = 0; o < surfaces.size(); ++o) {
    if (writer.failed()) break;
    if (plan.layout.uv[o].corners.empty()) continue;
    const SurfaceChunk surface = make_surface(plan, scene, o);
    if (!surface.keys.empty()) surfaces[o] = writer.put(encode_surface(surface));
  }
  LL_RETURN_IF_ERROR(writer.status());
  report.seconds_write = writer.seconds();

  const Manifest manifest = assemble(plan, scene, cells, cell_refs, relight, surfaces);
  LL_RETURN_IF_ERROR(write_manifest(loom, manifest));
  for (const auto* refs : {&cell_refs, &relight, &surfaces}) {
    for (const ChunkRef& ref : *refs) report.bytes_total += ref.size;
  }
  for (const ChunkRef& ref : relight) report.bytes_relight += ref.size;
  report.bytes_total += std::filesystem::file_size(loom / "manifest");
  if (report.receivers > 0) report.coefficients /= static_cast<double>(report.receivers);
  report.seconds_total = watch.seconds();
  return report;
}

}  // namespace lightloom
