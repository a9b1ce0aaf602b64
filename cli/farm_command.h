// What the commands that speak to a farm have in common.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "cli/command.h"
#include "cli/farm_client.h"

namespace lightloom {

struct FarmOptions {
  std::string server;
  int timeout = 30;  ///< seconds
  uint64_t job = 0;
  bool json = false;

  /// --server is HOST:PORT, --timeout in range. InvalidArgument.
  absl::Status check() const;
  /// Calls give up after --timeout, or when interrupted() (cli/interrupt.h).
  FarmClient connect() const;

  Option job_option() { return {"JOB", "its number", &job, true}; }
  Option server_option(bool required = true) {
    return {"--server", "HOST:PORT of lightloom-server", &server, required};
  }
  Option timeout_option() { return {"--timeout", "seconds to wait for a server that does not answer", &timeout}; }
};

/// A command with `own` options, and then --server, --timeout and --json, which all such commands have.
Command farm_command(
    const std::string& name, const std::string& help, std::shared_ptr<FarmOptions> farm, std::vector<Option> own,
    std::function<absl::Status()> run, std::function<absl::Status()> check = [] { return absl::OkStatus(); });

}  // namespace lightloom
