// lightloom list: a farm's jobs.
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
  LL_ASSIGN_OR_RETURN(const std::vector<RemoteJob> jobs, farm.jobs());
  if (o.json) {
    nlohmann::json all = nlohmann::json::array();
    for (const RemoteJob& job : jobs) all.push_back(to_json(job));
    print_json({{"jobs", all}});
    return absl::OkStatus();
  }
  for (const RemoteJob& job : jobs) {
    std::printf("%6llu  %-9s  %s  %s  %s\n", static_cast<unsigned long long>(job.id), job.state.c_str(),
                local_time(job.created_ms).c_str(), job.name.c_str(), progress_line(job).c_str());
  }
  if (jobs.empty()) std::printf("no jobs\n");
  return absl::OkStatus();
}

}  // namespace

Command list_command() {
  const auto o = std::make_shared<FarmOptions>();
  return farm_command("list", "Show a farm's jobs", o, {}, [o] { return run(*o); });
}

}  // namespace lightloom
