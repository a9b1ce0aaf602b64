// lightloom workers: who bakes at a farm.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/farm_command.h"
#include "cli/print_json.h"
#include "cli/progress.h"

namespace lightloom {
namespace {

absl::Status run(const FarmOptions& o) {
  FarmClient farm = o.connect();
  LL_ASSIGN_OR_RETURN(const std::vector<RemoteWorker> workers, farm.workers());
  if (o.json) {
    nlohmann::json all = nlohmann::json::array();
    for (const RemoteWorker& w : workers) {
      all.push_back({{"worker", w.id},
                     {"version", w.version},
                     {"threads", w.threads},
                     {"running", w.running},
                     {"silent_ms", w.silent_ms},
                     {"draining", w.draining}});
    }
    print_json({{"workers", all}});
    return absl::OkStatus();
  }
  for (const RemoteWorker& w : workers) {
    std::printf("%-32s  %u of %u threads busy, heard %s ago%s\n", w.id.c_str(), w.running, w.threads,
                human_seconds(1e-3 * static_cast<double>(w.silent_ms)).c_str(), w.draining ? ", leaving" : "");
  }
  if (workers.empty()) std::printf("no workers\n");
  return absl::OkStatus();
}

}  // namespace

Command workers_command() {
  const auto o = std::make_shared<FarmOptions>();
  return farm_command("workers", "Show who bakes at a farm", o, {}, [o] { return run(*o); });
}

}  // namespace lightloom
