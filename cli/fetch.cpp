// lightloom fetch: a finished job's asset.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/farm_command.h"
#include "cli/farm_steps.h"
#include "cli/files.h"
#include "cli/interrupt.h"
#include "cli/print_json.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

absl::Status run(const FarmOptions& o, const std::string& output) {
  cancel_on_interrupt();
  FarmClient farm = o.connect();
  LL_ASSIGN_OR_RETURN(const Manifest manifest, fetch_asset(&farm, o.job, output));
  if (o.json) {
    print_json({{"job", o.job}, {"cells", manifest.cells.size()}, {"probes", manifest.probes.size()}});
  } else {
    std::printf("%s: %zu cells, %zu probes\n", escape_controls(output).c_str(), manifest.cells.size(),
                manifest.probes.size());
  }
  return absl::OkStatus();
}

}  // namespace

Command fetch_command() {
  const auto o = std::make_shared<FarmOptions>();
  const auto output = std::make_shared<std::string>();
  return farm_command(
      "fetch", "Write a finished job's asset", o,
      {o->job_option(), {"-o,--output", "OUT.loom, a folder", output.get(), true}},
      [o, output] { return run(*o, *output); }, [output] { return OutputCheck({}).loom("-o", *output); });
}

}  // namespace lightloom
