// lightloom-worker: one baker of a farm. This process speaks with the server; a child of it does the work.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <csignal>
#include <string>
#include <string_view>
#include <thread>

#include "bake-worker/child_executor.h"
#include "bake-worker/default_name.h"
#include "bake-worker/join.h"
#include "bake-worker/memory_limits.h"
#include "bake-worker/worker.h"
#include "core/bake/canary.h"
#include "core/base/parse_size.h"
#include "core/base/stop_signal.h"
#include "core/base/version.h"
#include "proto/client.h"
#include "proto/worker_name.h"

namespace {

/// For an option that takes a size.
CLI::Option* add_size(CLI::App* app, const char* name, uint64_t* bytes, const char* help) {
  const auto parse = [name = std::string(name), bytes](const std::string& text) {
    const auto size = lightloom::parse_size(text);
    if (!size.ok()) throw CLI::ValidationError(name, std::string(size.status().message()));
    *bytes = *size;
  };
  return app->add_option_function<std::string>(name, parse, help)->type_name("SIZE");
}

/// Below this the program itself, its threads and libraries, has not enough to go on or to fail in good order.
void check_memory(const lightloom::ExecutorConfig& config) {
  const uint64_t least = (uint64_t{512} << 20) + config.threads * (uint64_t{32} << 20);
  if (config.memory_bytes == 0 || config.memory_bytes >= least) return;
  throw CLI::ValidationError("--memory", "must be at least " + lightloom::size_text(least) + " with " +
                                             std::to_string(config.threads) + " threads, or 0 for no limit");
}

/// Takes no more tasks at the first signal, hands back what runs at the second.
void stop_on_signals(lightloom::StopSignal* signals, lightloom::Worker* worker) {
  std::thread([signals, worker] {
    signals->wait();
    spdlog::info("finishing what it has; a second signal hands it back");
    worker->drain();
    signals->wait();
    worker->stop();
    for (;;) signals->wait();
  }).detach();
}

int fail(const std::string& what, const absl::Status& why) {
  spdlog::error("{}: {}", what, std::string(why.message()));
  return 1;
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == "executor") return lightloom::executor_main();
  CLI::App app{
      "Bakes for a farm: joins a server, runs its tasks until SIGINT or SIGTERM, then finishes those that it has; a "
      "second signal hands them back."};
  std::string name = lightloom::default_worker_name();
  uint32_t timeout = 10;
  lightloom::ExecutorConfig config;
  config.threads = std::max(1u, std::thread::hardware_concurrency());
  config.cache_bytes = lightloom::usable_memory() / 4;
  app.add_option("--server", config.server, "HOST:PORT of lightloom-server")->required();
  app.add_option("--threads", config.threads, "tasks at once")->check(CLI::Range(1, 1024))->capture_default_str();
  app.add_option("--name", name, "letters, digits, dots, dashes, underscores; no two workers may share one")
      ->check([](const std::string& text) {
        return std::string(lightloom::is_worker_name(text) ? "" : lightloom::kWorkerNameRule);
      });
  add_size(&app, "--cache", &config.cache_bytes, "memory for levels that are kept warm [a quarter of the memory]");
  add_size(&app, "--memory", &config.memory_bytes, "memory that tasks may use, like 8G [0: no limit]");
  app.add_option("--timeout", timeout, "seconds to wait for the server at the start")
      ->check(CLI::Range(1, 3600))
      ->capture_default_str();
  app.set_version_flag("--version", std::string(lightloom::kVersion));
  try {
    app.parse(argc, argv);
    check_memory(config);
  } catch (const CLI::ParseError& error) {
    return app.exit(error) == 0 ? 0 : 2;
  }

  spdlog::set_default_logger(spdlog::stderr_color_mt("lightloom-worker"));
  lightloom::StopSignal signals;
  const auto channel = lightloom::dial(config.server);
  lightloom::Introduction who = lightloom::introduce_this_machine(config.threads);
  if (who.avx2) {  // else the server says it better
    const auto canary = lightloom::bake_canary(static_cast<int>(config.threads));
    if (!canary.ok()) return fail("cannot bake here", canary.status());
    who.canary = *canary;
  }
  const auto joined = lightloom::join(channel, who, std::chrono::seconds(timeout));
  if (!joined.ok()) return fail("cannot join " + config.server, joined.status());
  spdlog::info("{} joined {} (version {}) with {} threads", name, config.server, *joined, config.threads);

  lightloom::ChildOptions child{config};
  const auto warn = [](const std::string& what) { spdlog::warn("{}", what); };
  child.on_end = warn;
  lightloom::ChildExecutor executor(child);
  lightloom::Worker worker(channel, &executor, {name, who, warn});
  stop_on_signals(&signals, &worker);
  if (const absl::Status ended = worker.run(); !ended.ok()) return fail("leaving " + config.server, ended);
  spdlog::info("left {}", config.server);
  return 0;
}
