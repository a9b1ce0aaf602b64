#include "cli/farm_command.h"

#include <chrono>
#include <utility>

#include "cli/interrupt.h"

namespace lightloom {

absl::Status FarmOptions::check() const {
  if (timeout >= 1 && timeout <= 3600) return absl::OkStatus();
  return absl::InvalidArgumentError("--timeout must be 1 to 3600 seconds");
}

FarmClient FarmOptions::connect() const { return FarmClient(server, std::chrono::seconds(timeout), &interrupted()); }

Command farm_command(const std::string& name, const std::string& help, std::shared_ptr<FarmOptions> farm,
                     std::vector<Option> own, std::function<absl::Status()> run, std::function<absl::Status()> check) {
  own.push_back(farm->server_option());
  own.push_back(farm->timeout_option());
  own.push_back({"--json", "print it as JSON", &farm->json});
  return {name, help, std::move(own),
          [farm, check = std::move(check)] {
            LL_RETURN_IF_ERROR(farm->check());
            return check();
          },
          std::move(run)};
}

}  // namespace lightloom
