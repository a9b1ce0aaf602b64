#include "core/bake/bake.h"

#include <atomic>
#include <mutex>

#include "core/asset/asset.h"
#include "core/bake/assemble.h"
#include "core/bake/session.h"
#include "core/base/stopwatch.h"

namespace lightloom {
namespace {

/// The first error of many threads.
class FirstError {
 public:
  void note(const absl::Status& status) {
    const std::lock_guard lock(mutex_);
    if (status_.ok()) status_ = status;
    failed_ = true;
  }
  /// Further work is not worth it.
  bool failed() const { return failed_.load(std::memory_order_relaxed); }
  /// REQUIRES: the threads have ended.
  const absl::Status& status() const { return status_; }

 private:
  std::mutex mutex_;
  std::atomic<bool> failed_{false};
  absl::Status status_;  // guarded by mutex_
};

absl::Status cancelled(const std::filesystem::path& loom) {
  std::error_code error;
  const bool old = std::filesystem::exists(loom / "manifest", error);
  return absl::CancelledError("bake cancelled; " + loom.string() +
                              (old ? " still holds the earlier bake, whole" : " holds no asset yet: bake again"));
}

void add_cell(const CellRecord& c, BakeReport* report) {
  report->rays_gather += c.gather_rays;
  report->unseen += c.unseen;
  report->clusters += c.clusters.size();
  report->coefficients += static_cast<double>(c.coefficients);
  report->bytes_projection += c.bytes_projection;
  report->bytes_reconstruction += c.bytes_reconstruction;
}

}  // namespace

absl::StatusOr<BakeReport> bake(const RayTracer& tracer, const BakeParams& params, const std::filesystem::path& loom,
                                const BakeControl& control) {
  const Stopwatch watch;
  BakeReport report;
  LL_ASSIGN_OR_RETURN(const auto session, BakeSession::create(tracer, params, control));
  const Plan& plan = session->plan();
  report.seconds_plan = watch.seconds();
  report.seconds_receivers = plan.seconds_receivers;
  report.seconds_probes = plan.seconds_probes;
  report.receivers = plan.receivers.all.size();
  report.repairs = plan.placement.repairs;
  report.cells = plan.cells.size();

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

  const Stopwatch cells_watch;
  std::vector<CellRecord> cells(plan.cells.size());
  std::mutex mutex;  // guards the next two
  double transport = 0, compress = 0;
  Parallel cell_stage = control.stage("cells");
  if (control.progress) {
    cell_stage.progress = [&](uint64_t finished, uint64_t total) {
      control.progress("cells", finished, total, session->cell_rays());
    };
  }
  bool done = parallel_for(cells.size(), cell_stage, [&](uint64_t i) {
    if (error.failed()) return;
    auto cell = session->cell(i, sink, control.cancel);
    if (!cell.ok()) return error.note(cell.status());
    cells[i] = std::move(cell->record);
    const std::lock_guard lock(mutex);
    transport += cell->transport_seconds;
    compress += cell->compress_seconds;
  });
  LL_RETURN_IF_ERROR(outcome(done));
  for (const CellRecord& c : cells) add_cell(c, &report);
  report.rays_visibility = session->cell_rays() - report.rays_gather;
  // The threads' shares of the stage's wall time.
  const double cells_seconds = cells_watch.seconds();
  if (transport + compress > 0) {
    report.seconds_transport = cells_seconds * transport / (transport + compress);
    report.seconds_compress = cells_seconds - report.seconds_transport;
  }

  // Probes that no cell reads need no relight sets.
  const std::vector<uint32_t> used = used_probes(cells);
  report.probes = used.size();
  const Stopwatch relight_watch;
  std::vector<ChunkRef> relight(plan.placement.probes.size());
  done = parallel_for(used.size(), control.stage("relight rays"), [&](uint64_t i) {
    if (error.failed()) return;
    const auto refs = session->relight(used[i], 1, sink, control.cancel);
    if (!refs.ok()) return error.note(refs.status());
    relight[used[i]] = refs->front();
  });
  LL_RETURN_IF_ERROR(outcome(done));
  report.seconds_relight = relight_watch.seconds();
  report.rays_relight = used.size() * static_cast<uint64_t>(plan.params.relight_rays);
  std::vector<ChunkRef> surfaces(session->scene().objects.size());
  for (size_t o = 0; o < surfaces.size(); ++o) {
    LL_ASSIGN_OR_RETURN(surfaces[o], session->surface(o, sink));
  }
  report.seconds_write = seconds_write;

  LL_ASSIGN_OR_RETURN(const Manifest manifest, session->manifest(cells, relight, surfaces));
  LL_RETURN_IF_ERROR(write_manifest(loom, manifest));
  for (const CellRecord& c : cells) report.bytes_total += c.chunk.size;
  for (const ChunkRef& ref : relight) report.bytes_relight += ref.size;
  for (const ChunkRef& ref : surfaces) report.bytes_total += ref.size;
  report.bytes_total += report.bytes_relight + std::filesystem::file_size(loom / "manifest");
  if (report.receivers > 0) report.coefficients /= static_cast<double>(report.receivers);
  report.seconds_total = watch.seconds();
  return report;
}

}  // namespace lightloom
