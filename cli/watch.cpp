// lightloom watch: a job's progress until it ends.
#include <cstdio>
#include <memory>

#include "cli/farm_command.h"
#include "cli/farm_print.h"
#include "cli/interrupt.h"
#include "cli/job_progress.h"
#include "cli/progress.h"

namespace lightloom {
namespace {

absl::Status run(const FarmOptions& o) {
  cancel_on_interrupt();
  FarmClient farm = o.connect();
  JobProgress progress(o.json ? JobProgress::Output::kJson : JobProgress::Output::kText);
  LL_ASSIGN_OR_RETURN(const RemoteJob job,
                      farm.watch(o.job, interrupted(), [&](const RemoteJob& now) { progress.show(now); }));
  progress.finish();
  if (!o.json) {
    std::printf("job %llu: %s after %s, %s\n", static_cast<unsigned long long>(job.id), job.state.c_str(),
                human_seconds(1e-3 * static_cast<double>(job.finished_ms - job.created_ms)).c_str(),
                progress_line(job).c_str());
  }
  return how_it_ended(job, o.server);
}

}  // namespace

Command watch_command() {
  const auto o = std::make_shared<FarmOptions>();
  return farm_command("watch", "Follow a job until it ends; with --json, a line for each change", o, {o->job_option()},
                      [o] { return run(*o); });
}

}  // namespace lightloom
