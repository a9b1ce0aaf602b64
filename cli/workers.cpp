// lightloom workers: who bakes at a farm.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/farm_command.h"
#include "cli/farm_print.h"
#include "cli/print_json.h"

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
  for (const RemoteWorker& w : workers) std::printf("%s\n", worker_line(w).c_str());
  if (workers.empty()) std::printf("no workers\n");
  return absl::OkStatus();
}

}  // namespace

Command workers_command() {
  const auto o = std::make_shared<FarmOptions>();
  return farm_command("workers", "Show who bakes at a farm", o, {}, [o] { return run(*o); });
}

}  // namespace lightloom
