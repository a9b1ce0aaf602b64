// lightloom-server: the coordinator of a bake farm.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <string>

#include "bake-server/grpc/server.h"
#include "core/base/stop_signal.h"
#include "core/base/version.h"
#include "proto/protocol_version.h"

int main(int argc, char** argv) {
  CLI::App app{"Coordinates a bake farm: takes jobs, hands their tasks to workers, keeps what they give."};
  std::string listen = "127.0.0.1:7000", state;
  app.add_option("--listen", listen, "HOST:PORT to listen on; loopback only, port 0 takes a free one")
      ->capture_default_str();
  app.add_option("--state", state, "folder for jobs and blobs; made if it is not there")->required();
  app.set_version_flag("--version", std::string(lightloom::kVersion));
  CLI11_PARSE(app, argc, argv);

  spdlog::set_default_logger(spdlog::stderr_color_mt("lightloom-server"));
  lightloom::StopSignal stop;
  const auto farm = lightloom::Farm::open(state);
  if (!farm.ok()) {
    spdlog::error("{}", std::string(farm.status().message()));
    return 1;
  }
  const auto server = lightloom::Server::start(listen,
                                               {.version = std::string(lightloom::kVersion),
                                                .protocol_version = lightloom::kProtocolVersion,
                                                .method_version = std::string(lightloom::kMethodVersion)},
                                               farm->get());
  if (!server.ok()) {
    spdlog::error("{}", std::string(server.status().message()));
    return 1;
  }
  spdlog::info("listening on {}", (*server)->address());
  const int signal = stop.wait();
  spdlog::info("stopping on {}", signal == SIGINT ? "SIGINT" : "SIGTERM");
  return 0;
}
