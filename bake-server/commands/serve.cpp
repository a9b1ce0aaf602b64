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
  LL_ASSIGN_OR_RETURN(const auto farm, Farm::open(options.state, {}, Durability::kPowerLoss, options.limits));
  const ServerInfo info{.version = std::string(kVersion),
                        .protocol_version = kProtocolVersion,
                        .method_version = std::string(kMethodVersion),
                        .canary = kCanary};
  LL_ASSIGN_OR_RETURN(const auto server, Server::start(options.listen, info, farm.get(), options.insecure));
  if (options.insecure) spdlog::warn("--insecure: whoever reaches {} may read and change all jobs", server->address());
  spdlog::info("listening on {}", server->address());
  const int signal = stop.wait();
  spdlog::info("stopping on {}", signal == SIGINT ? "SIGINT" : "SIGTERM");
  return absl::OkStatus();
}

}  // namespace lightloom
