// lightloom set-priority: which jobs go first.
#include <memory>

#include "cli/farm_command.h"
#include "cli/farm_print.h"

namespace lightloom {

Command set_priority_command() {
  const auto o = std::make_shared<FarmOptions>();
  const auto priority = std::make_shared<int>(0);
  return farm_command("set-priority", "Let a job go before those of lower priority, or after those of higher", o,
                      {o->job_option(), {"N", "higher ones first; 0 is usual", priority.get(), true}}, [o, priority] {
                        FarmClient farm = o->connect();
                        LL_ASSIGN_OR_RETURN(const RemoteJob job, farm.set_priority(o->job, *priority));
                        print_job(job, "priority " + std::to_string(job.priority), o->json);
                        return absl::OkStatus();
                      });
}

}  // namespace lightloom
