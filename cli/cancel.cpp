// lightloom cancel: ends a job.
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
  LL_ASSIGN_OR_RETURN(const RemoteJob job, farm.cancel(o.job));
  if (o.json) {
    print_json(to_json(job));
  } else {
    std::printf("job %llu: %s\n", static_cast<unsigned long long>(job.id), job.state.c_str());
  }
  return absl::OkStatus();
}

}  // namespace

Command cancel_command() {
  const auto o = std::make_shared<Options>();
  return {"cancel",
          "End a job; one that has ended stays as it is",
          {{"JOB", "its number", &o->job, true},
           {"--server", "HOST:PORT of lightloom-server", &o->server, true},
           {"--json", "print it as JSON", &o->json}},
          [] { return absl::OkStatus(); },
          [o] { return run(*o); }};
}

}  // namespace lightloom
