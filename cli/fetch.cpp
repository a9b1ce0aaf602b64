// lightloom fetch: a finished job's asset.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/farm_client.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/print_json.h"
#include "cli/progress.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

struct Options {
  std::string server, output;
  uint64_t job = 0;
  bool json = false;
};

absl::Status run(const Options& o) {
  cancel_on_interrupt();
  FarmClient farm(o.server);
  ProgressBar bar;
  LL_ASSIGN_OR_RETURN(
      const Manifest manifest,
      farm.fetch(o.job, o.output, interrupted(), [&](uint64_t there, uint64_t of) { bar.update("fetch", there, of); }));
  bar.finish();
  if (o.json) {
    print_json({{"job", o.job}, {"cells", manifest.cells.size()}, {"probes", manifest.probes.size()}});
  } else {
    std::printf("%s: %zu cells, %zu probes\n", escape_controls(o.output).c_str(), manifest.cells.size(),
                manifest.probes.size());
  }
  return absl::OkStatus();
}

}  // namespace

Command fetch_command() {
  const auto o = std::make_shared<Options>();
  return {"fetch",
          "Write a finished job's asset",
          {{"JOB", "its number", &o->job, true},
           {"-o,--output", "OUT.loom, a folder", &o->output, true},
           {"--server", "HOST:PORT of lightloom-server", &o->server, true},
           {"--json", "print what it holds as JSON", &o->json}},
          [o] { return OutputCheck({}).loom("-o", o->output); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
