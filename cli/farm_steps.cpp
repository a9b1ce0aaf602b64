#include "cli/farm_steps.h"

#include <filesystem>

#include "cli/farm_print.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/job_progress.h"
#include "core/base/file.h"
#include "core/base/stopwatch.h"

namespace lightloom {
namespace {

absl::Status with(const absl::Status& status, const std::string& more) {
  return {status.code(), std::string(status.message()) + "; " + more};
}

/// The user has stopped the bake: so the farm need not go on either.
absl::Status cancel_job(FarmClient* farm, const std::string& server, uint64_t id) {
  const std::string job = "job " + std::to_string(id) + " at " + server;
  const auto cancelled = farm->cancel(id);
  if (!cancelled.ok()) {
    return absl::CancelledError("bake stopped, but " + job + " may go on, since " + server +
                                " did not answer: lightloom cancel " + std::to_string(id) + " --server " + server);
  }
  return absl::CancelledError("bake stopped, " + job + " is " + cancelled->state +
                              "; what is done stays there, and is used again when this level is baked again");
}

}  // namespace

absl::Status check_farm_level(const std::string& scene) {
  LL_RETURN_IF_ERROR(check_input(scene));
  if (std::filesystem::path(scene).extension() == ".glb") return absl::OkStatus();
  return absl::InvalidArgumentError(scene + " must be a .glb, which holds all of the level: export it as one");
}

absl::StatusOr<RemoteJob> submit_level(FarmClient* farm, const std::string& scene, const BakeParams& params,
                                       const EarlierBake* earlier, const std::string& name, int32_t priority) {
  LL_ASSIGN_OR_RETURN(const std::vector<uint8_t> bytes, read_file(scene));
  ProgressBar bar;
  return farm->submit(bytes, params, earlier, name.empty() ? std::filesystem::path(scene).stem().string() : name,
                      priority, [&](uint64_t there) { bar.update("upload", there, bytes.size()); });
}

absl::StatusOr<Manifest> fetch_asset(FarmClient* farm, uint64_t job, const std::string& loom) {
  ProgressBar bar;
  return farm->fetch(job, loom, interrupted(), [&](uint64_t there, uint64_t of) { bar.update("fetch", there, of); });
}

absl::StatusOr<FarmBake> farm_bake(FarmClient* farm, const std::string& server, const std::string& scene,
                                   const BakeParams& params, const EarlierBake* earlier, const std::string& loom) {
  const Stopwatch watch;
  FarmBake out;
  LL_ASSIGN_OR_RETURN(out.job, submit_level(farm, scene, params, earlier, "", 0));
  const std::string id = std::to_string(out.job.id);
  {
    JobProgress progress(JobProgress::Output::kBar);
    auto end = farm->watch(out.job.id, interrupted(), [&](const RemoteJob& now) { progress.show(now); });
    if (absl::IsCancelled(end.status())) return cancel_job(farm, server, out.job.id);
    if (!end.ok())
      return with(end.status(), "job " + id + " stays there: lightloom watch " + id + " --server " + server);
    out.job = *std::move(end);
  }
  LL_RETURN_IF_ERROR(how_it_ended(out.job, server));
  const Stopwatch write_watch;
  const auto manifest = fetch_asset(farm, out.job.id, loom);
  if (!manifest.ok()) {
    return with(manifest.status(),
                "job " + id + " is done: lightloom fetch " + id + " --server " + server + " -o " + loom);
  }
  out.report = report_of(*manifest);
  out.report.seconds_write = write_watch.seconds();
  out.report.seconds_total = watch.seconds();
  return out;
}

}  // namespace lightloom
