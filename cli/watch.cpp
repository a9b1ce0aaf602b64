// lightloom watch: a job's progress until it ends.
#include <unistd.h>

#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/farm_client.h"
#include "cli/farm_print.h"
#include "cli/interrupt.h"
#include "cli/print_json.h"
#include "cli/progress.h"

namespace lightloom {
namespace {

struct Options {
  std::string server;
  uint64_t job = 0;
  bool json = false;
};

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  FarmClient farm(o.server);
  ProgressBar bar;
  const bool terminal = ::isatty(STDERR_FILENO) == 1;
  const auto show = [&](const RemoteJob& job) {
    if (o.json) {
      print_json(to_json(job));
      std::fflush(stdout);
    } else if (terminal) {
      bar.update("job " + std::to_string(job.id) + ", " + std::to_string(job.workers) + " workers", job.done, job.tasks,
                 job.rays);
    } else {
      std::printf("%s\n", progress_line(job).c_str());
      std::fflush(stdout);
    }
  };
  LL_ASSIGN_OR_RETURN(const RemoteJob job, farm.watch(o.job, interrupted(), show));
  bar.finish();
  if (!o.json) {
    std::printf("job %llu: %s after %s, %s\n", static_cast<unsigned long long>(job.id), job.state.c_str(),
                human_seconds(1e-3 * static_cast<double>(job.finished_ms - job.created_ms)).c_str(),
                progress_line(job).c_str());
  }
  return how_it_ended(job);
}

}  // namespace

Command watch_command() {
  const auto o = std::make_shared<Options>();
  return {"watch",
          "Follow a job until it ends",
          {{"JOB", "its number", &o->job, true},
           {"--server", "HOST:PORT of lightloom-server", &o->server, true},
           {"--json", "print each state as a line of JSON", &o->json}},
          [] { return absl::OkStatus(); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
