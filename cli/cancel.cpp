// lightloom cancel: ends a job.
#include <memory>

#include "cli/farm_command.h"
#include "cli/farm_print.h"

namespace lightloom {

Command cancel_command() {
  const auto o = std::make_shared<FarmOptions>();
  return farm_command("cancel", "End a job; one that has ended stays as it is", o, {o->job_option()}, [o] {
    FarmClient farm = o->connect();
    LL_ASSIGN_OR_RETURN(const RemoteJob job, farm.cancel(o->job));
    print_job(job, job.state, o->json);
    return absl::OkStatus();
  });
}

}  // namespace lightloom
