#include "core/bake/bake.h"

#include <algorithm>
#include <atomic>
#include <cmath>

#include "core/asset/asset.h"
#include "core/bake/assemble.h"
#include "core/bake/reuse.h"
#include "core/bake/session.h"
#include "core/base/first_error.h"
#include "core/base/half.h"
#include "core/base/sh.h"
#include "core/base/stopwatch.h"

namespace lightloom {
namespace {

absl::Status cancelled(const std::filesystem::path& loom) {
  std::error_code error;
  const bool old = std::filesystem::exists(loom / "manifest", error);
  return absl::CancelledError("bake cancelled; " + loom.string() +
                              (old ? " still holds the earlier bake, whole" : " holds no asset yet: bake again"));
}

}  // namespace

void count_reused(const Reuse& reuse, const Manifest& m, BakeReport* report) {
  for (size_t i = 0; i < reuse.cells.size(); ++i) {
    if (reuse.cells[i].why != ReuseItem::kHolds) continue;
    ++report->cells_reused;
    report->clusters_reused += m.cells[i].clusters;
    report->rays_gather_reused += uint64_t{m.cells[i].receivers} * static_cast<uint64_t>(m.params.rays);
  }
  for (const ReuseItem& probe : reuse.probes) report->probes_reused += probe.why == ReuseItem::kHolds;
}

BakeReport report_of(const Manifest& m) {
  BakeReport r;
  r.probes = m.probes.size();
  r.cells = m.cells.size();
  r.clusters = m.clusters.size();
  r.repairs = static_cast<uint64_t>(std::count_if(m.probes.begin(), m.probes.end(), [&](const ProbeEntry& p) {
    return m.params.method == BakeMethod::kDefault && p.slot > 0;
  }));
  r.rays_relight = r.probes * static_cast<uint64_t>(m.params.relight_rays);
  double coefficients = 0;
  for (const CellEntry& c : m.cells) {
    const uint64_t rays = uint64_t{c.receivers} * static_cast<uint64_t>(m.params.rays);
    r.receivers += c.receivers;
    r.rays_gather += rays;
    r.unseen += static_cast<uint64_t>(std::llround(static_cast<double>(c.unseen) * static_cast<double>(rays)));
    r.cells_stale += c.stale > 0;
    r.stale = std::max(r.stale, static_cast<double>(c.stale));
    r.bytes_total += c.chunk.size;
    r.bytes_reconstruction += c.receivers * sizeof(uint16_t);
  }
  for (const ClusterEntry& k : m.clusters) {
    coefficients += static_cast<double>(k.rank) * k.receivers;
    const uint64_t stride = static_cast<uint64_t>(sh_stride(m.params.order)), padded = (k.receivers + 7) / 8 * 8;
    r.bytes_projection += k.rank * (k.probes * stride * sizeof(Half) + sizeof(float));
    r.bytes_reconstruction += k.rank * padded * sizeof(Half);
  }
  for (const ProbeEntry& p : m.probes) r.bytes_relight += p.relight.size;
  for (const ObjectEntry& o : m.objects) r.bytes_total += o.surface.size;
  r.bytes_total += r.bytes_relight + encode_manifest(m).size();
  if (r.receivers > 0) r.coefficients = coefficients / static_cast<double>(r.receivers);
  return r;
}

absl::StatusOr<BakeReport> bake(const RayTracer& tracer, const BakeParams& params, const std::filesystem::path& loom,
                                const BakeControl& control, const BakeTraces* earlier, double tolerance) {
  const Stopwatch watch;
  LL_ASSIGN_OR_RETURN(const auto session, BakeSession::create(tracer, params, control));
  const double seconds_plan = watch.seconds();
  const Plan& plan = session->plan();

  const ChunkStore store = chunk_store(loom);
  std::atomic<double> seconds_write{0};
  const ChunkSink sink = [&](std::span<const uint8_t> bytes) {
    const Stopwatch write_watch;
    auto ref = store.put(bytes);
    seconds_write += write_watch.seconds();
    return ref;
  };
  FirstError error;
  // How a stage ended; `done` is what parallel_for said.
  const auto outcome = [&](bool done) {
    if (error.status().ok() ? !done : absl::IsCancelled(error.status())) return cancelled(loom);
    return error.status();
  };

  std::vector<CellRecord> cells(plan.cells.size());
  std::vector<RelightRecord> relight(plan.placement.probes.size());
  Reuse reuse = no_reuse(plan);
  if (earlier != nullptr) {
    LL_ASSIGN_OR_RETURN(
        reuse, find_reuse(plan, session->scene(), session->world(), *earlier, tolerance, control.stage("reuse")));
    for (size_t i = 0; i < cells.size(); ++i) {
      if (reuse.cells[i].why != ReuseItem::kHolds) continue;
      cells[i] = earlier->cells[reuse.cells[i].earlier];
      cells[i].stale = static_cast<float>(reuse.cells[i].share);
    }
    for (size_t i = 0; i < relight.size(); ++i) {
      if (reuse.probes[i].why == ReuseItem::kHolds) relight[i] = earlier->probes[reuse.probes[i].earlier];
    }
  }

  const std::vector<uint32_t> dirty_cells = dirty_first(reuse.cells);
  Parallel cell_stage = control.stage("cells");
  if (control.progress) {
    cell_stage.progress = [&](uint64_t finished, uint64_t total) {
      control.progress("cells", finished, total, session->spent().cell_rays());
    };
  }
  bool done = parallel_for(dirty_cells.size(), cell_stage, [&](uint64_t i) {
    if (error.failed()) return;
    auto cell = session->cell(dirty_cells[i], sink, control.cancel);
    if (!cell.ok()) return error.note(cell.status());
    cells[dirty_cells[i]] = std::move(cell->record);
  });
  LL_RETURN_IF_ERROR(outcome(done));

  // Probes that no cell reads need no relight sets.
  LL_ASSIGN_OR_RETURN(std::vector<uint32_t> wanted, used_probes(plan, cells));
  std::erase_if(wanted, [&](uint32_t p) { return reuse.probes[p].why == ReuseItem::kHolds; });
  done = parallel_for(wanted.size(), control.stage("relight rays"), [&](uint64_t i) {
    if (error.failed()) return;
    auto records = session->relight(wanted[i], 1, sink, control.cancel);
    if (!records.ok()) return error.note(records.status());
    relight[wanted[i]] = std::move(records->front());
  });
  LL_RETURN_IF_ERROR(outcome(done));
  std::vector<ChunkRef> surfaces(session->scene().objects.size());
  for (size_t o = 0; o < surfaces.size(); ++o) {
    LL_ASSIGN_OR_RETURN(surfaces[o], session->surface(o, sink));
  }

  LL_ASSIGN_OR_RETURN(const BakeSession::Finished finished,
                      session->finish(std::move(cells), std::move(relight), surfaces));
  const Manifest& manifest = finished.manifest;
  LL_RETURN_IF_ERROR(write_manifest(loom, manifest, encode_bake_traces(finished.traces)));
  BakeReport report = report_of(manifest);
  add_times(*session, control.threads, &report);
  count_reused(reuse, manifest, &report);
  report.seconds_plan = seconds_plan;
  report.seconds_write = seconds_write;
  report.seconds_total = watch.seconds();
  return report;
}

void add_times(const BakeSession& session, int threads, BakeReport* report) {
  const BakeSession::Spent spent = session.spent();
  const double share = 1.0 / thread_count(threads);
  report->rays_visibility = spent.visibility_rays;
  report->seconds_receivers = session.plan().seconds_receivers;
  report->seconds_probes = session.plan().seconds_probes;
  report->seconds_transport = spent.transport_seconds * share;
  report->seconds_compress = spent.compress_seconds * share;
  report->seconds_relight = spent.relight_seconds * share;
}

}  // namespace lightloom
