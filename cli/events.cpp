// lightloom events: what happened to a job.
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>

#include "cli/farm_command.h"
#include "cli/farm_print.h"
#include "cli/print_json.h"

namespace lightloom {

Command events_command() {
  const auto o = std::make_shared<FarmOptions>();
  return farm_command("events", "Show what happened to a job; with --json, a line for each", o, {o->job_option()}, [o] {
    FarmClient farm = o->connect();
    LL_ASSIGN_OR_RETURN(const std::vector<RemoteEvent> events, farm.events(o->job));
    for (const RemoteEvent& e : events) {
      if (o->json) {
        print_json({{"at_ms", e.at_ms}, {"task", e.task}, {"worker", e.worker}, {"what", e.what}});
      } else {
        std::printf("%s  %-14s  %-24s  %s\n", local_time(e.at_ms).c_str(), e.task.c_str(), e.worker.c_str(),
                    e.what.c_str());
      }
    }
    return absl::OkStatus();
  });
}

}  // namespace lightloom
