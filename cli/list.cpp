// lightloom list: a farm's jobs.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/command.h"
#include "cli/farm_client.h"
#include "cli/farm_print.h"
#include "cli/print_json.h"

namespace lightloom {
namespace {

struct Options {
  std::string server;
  bool json = false;
};

absl::Status run(const Options& o) {
  FarmClient farm(o.server);
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
  const auto o = std::make_shared<Options>();
  return {"list",
          "Show a farm's jobs",
          {{"--server", "HOST:PORT of lightloom-server", &o->server, true}, {"--json", "print them as JSON", &o->json}},
          [] { return absl::OkStatus(); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
