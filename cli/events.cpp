// lightloom events: what happened to a job.
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
  uint64_t job = 0;
  bool json = false;
};

absl::Status run(const Options& o) {
  FarmClient farm(o.server);
  LL_ASSIGN_OR_RETURN(const std::vector<RemoteEvent> events, farm.events(o.job));
  for (const RemoteEvent& e : events) {
    if (o.json) {
      print_json({{"at_ms", e.at_ms}, {"task", e.task}, {"worker", e.worker}, {"what", e.what}});
      continue;
    }
    std::printf("%s  %-14s  %-24s  %s\n", local_time(e.at_ms).c_str(), e.task.c_str(), e.worker.c_str(),
                e.what.c_str());
  }
  return absl::OkStatus();
}

}  // namespace

Command events_command() {
  const auto o = std::make_shared<Options>();
  return {"events",
          "Show what happened to a job",
          {{"JOB", "its number", &o->job, true},
           {"--server", "HOST:PORT of lightloom-server", &o->server, true},
           {"--json", "print each as a line of JSON", &o->json}},
          [] { return absl::OkStatus(); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
