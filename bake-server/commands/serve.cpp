#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <csignal>

#include "bake-server/commands/commands.h"
#include "bake-server/grpc/server.h"
#include "core/bake/canary.h"
#include "core/base/stop_signal.h"
#include "core/base/version.h"
#include "proto/protocol_version.h"

namespace lightloom {

absl::Status serve(const ServeOptions& options) {
  StopSignal stop;
  LL_ASSIGN_OR_RETURN(const auto farm,
                      Farm::open(options.state, {}, Durability::kPowerLoss, options.limits, options.database));
  const ServerInfo info{.version = std::string(kVersion),
                        .protocol_version = kProtocolVersion,
                        .method_version = std::string(kMethodVersion),
                        .canary = kCanary};
  LL_ASSIGN_OR_RETURN(const auto server, Server::start(options.listen, info, farm.get(), options.insecure));
  if (options.insecure) {
    spdlog::warn(absl::StrCat("--insecure: whoever reaches ", server->address(), " may read and change all jobs"));
  }
  spdlog::info("listening on " + server->address());
  const int signal = stop.wait();
  spdlog::info(signal == SIGINT ? "stopping on SIGINT" : "stopping on SIGTERM");
  return absl::OkStatus();
}

}  // namespace lightloom
