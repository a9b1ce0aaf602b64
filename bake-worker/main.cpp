// lightloom-worker: one baker of a farm.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <string>
#include <thread>

#include "bake-worker/join.h"
#include "core/base/version.h"

int main(int argc, char** argv) {
  CLI::App app{
      "Joins a bake farm. In this release it says who it is, learns whether the server would have it, and "
      "ends: tasks "
      "come with a later one. Exit code 0: accepted."};
  std::string server;
  uint32_t threads = std::max(1u, std::thread::hardware_concurrency());
  uint32_t timeout = 10;
  app.add_option("--server", server, "HOST:PORT of lightloom-server")->required();
  app.add_option("--threads", threads, "threads to bake with")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--timeout", timeout, "seconds to wait for the server")
      ->check(CLI::Range(1, 3600))
      ->capture_default_str();
  app.set_version_flag("--version", std::string(lightloom::kVersion));
  CLI11_PARSE(app, argc, argv);

  spdlog::set_default_logger(spdlog::stderr_color_mt("lightloom-worker"));
  const auto joined = lightloom::join(lightloom::dial(server), lightloom::introduce_this_machine(threads),
                                      std::chrono::seconds(timeout));
  if (!joined.ok()) {
    spdlog::error("cannot join {}: {}", server, std::string(joined.status().message()));
    return 1;
  }
  spdlog::info("joined {} (version {}) with {} threads; this release has no tasks, so that is all", server, *joined,
               threads);
  return 0;
}
