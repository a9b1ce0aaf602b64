// lightloom-worker: one baker of a farm.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <string>
#include <thread>

#include "bake-worker/join.h"
#include "bake-worker/worker.h"
#include "core/base/stop_signal.h"
#include "core/base/version.h"
#include "proto/client.h"

namespace {

std::string default_name() {
  char host[48] = "worker";
  gethostname(host, sizeof host - 1);
  return std::string(host) + "-" + std::to_string(getpid());
}

}  // namespace

int main(int argc, char** argv) {
  CLI::App app{
      "Bakes for a farm: joins a server, runs its tasks until SIGINT or SIGTERM, then finishes those that it has; a "
      "second "
      "signal hands them back."};
  std::string server, name = default_name();
  uint32_t threads = std::max(1u, std::thread::hardware_concurrency()), timeout = 10, levels = 2;
  app.add_option("--server", server, "HOST:PORT of lightloom-server")->required();
  app.add_option("--threads", threads, "tasks at once")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--name", name, "letters, digits, dots and dashes; no two workers may share one");
  app.add_option("--levels", levels, "levels kept in memory")->check(CLI::Range(1, 64))->capture_default_str();
  app.add_option("--timeout", timeout, "seconds to wait for the server at the start")
      ->check(CLI::Range(1, 3600))
      ->capture_default_str();
  app.set_version_flag("--version", std::string(lightloom::kVersion));
  CLI11_PARSE(app, argc, argv);

  spdlog::set_default_logger(spdlog::stderr_color_mt("lightloom-worker"));
  lightloom::StopSignal signals;
  const auto channel = lightloom::dial(server);
  const lightloom::Introduction who = lightloom::introduce_this_machine(threads);
  const auto joined = lightloom::join(channel, who, std::chrono::seconds(timeout));
  if (!joined.ok()) {
    spdlog::error("cannot join {}: {}", server, std::string(joined.status().message()));
    return 1;
  }
  spdlog::info("{} joined {} (version {}) with {} threads", name, server, *joined, threads);

  lightloom::Worker worker(channel, {.name = name, .who = who, .sessions = levels});
  std::thread([&] {
    signals.wait();
    spdlog::info("finishing what it has; a second signal hands it back");
    worker.drain();
    signals.wait();
    worker.stop();
    for (;;) signals.wait();
  }).detach();
  const absl::Status ended = worker.run();
  if (!ended.ok()) {
    spdlog::error("{} refuses: {}", server, std::string(ended.message()));
    return 1;
  }
  spdlog::info("left {}", server);
  return 0;
}
