// lightloom-worker: one baker of a farm. This process speaks with the server; a child of it does the work.
#include <absl/strings/str_cat.h>
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
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
#include "core/command_line/program.h"
#include "proto/client.h"
#include "proto/worker_name.h"

namespace {

using namespace lightloom;

struct ProgramOptions {
  std::string name = default_worker_name();
  uint32_t timeout = 10;  // seconds
  ExecutorConfig config;
};

absl::Status check(const ProgramOptions& o) {
  const ExecutorConfig& config = o.config;
  if (config.threads < 1 || config.threads > 1024) return absl::InvalidArgumentError("--threads must be 1 to 1024");
  if (o.timeout < 1 || o.timeout > 3600) return absl::InvalidArgumentError("--timeout must be 1 to 3600");
  if (!is_worker_name(o.name)) return absl::InvalidArgumentError(absl::StrCat("--name: ", kWorkerNameRule));
  // Below this the program itself, its threads and libraries, has not enough to go on or to fail in good order.
  const uint64_t least = (uint64_t{512} << 20) + config.threads * (uint64_t{32} << 20);
  if (config.memory_bytes == 0 || config.memory_bytes >= least) return absl::OkStatus();
  return absl::InvalidArgumentError(absl::StrCat("--memory must be at least ", size_text(least), " with ",
                                                 config.threads, " threads, or 0 for no limit"));
}

/// Takes no more tasks at the first signal, hands back what runs at the second.
void stop_on_signals(StopSignal* signals, Worker* worker) {
  std::thread([signals, worker] {
    signals->wait();
    spdlog::info("finishing what it has; a second signal hands it back");
    worker->drain();
    signals->wait();
    worker->stop();
    for (;;) signals->wait();
  }).detach();
}

absl::Status because(const std::string& what, const absl::Status& why) {
  return absl::Status(why.code(), absl::StrCat(what, ": ", why.message()));
}

absl::Status work(const ProgramOptions& o) {
  static StopSignal signals;  // what waits for them is detached
  const ExecutorConfig& config = o.config;
  const auto channel = dial(config.server);
  Introduction who = introduce_this_machine(config.threads);
  if (who.avx2) {  // else the server says it better
    const auto canary = bake_canary(static_cast<int>(config.threads));
    if (!canary.ok()) return because("cannot bake here", canary.status());
    who.canary = *canary;
  }
  const auto joined = join(channel, who, std::chrono::seconds(o.timeout));
  if (!joined.ok()) return because("cannot join " + config.server, joined.status());
  spdlog::info(
      absl::StrCat(o.name, " joined ", config.server, " (version ", *joined, ") with ", config.threads, " threads"));

  ChildOptions child{config};
  const auto warn = [](const std::string& what) { spdlog::warn(what); };
  child.on_end = warn;
  ChildExecutor executor(child);
  Worker worker(channel, &executor, {o.name, who, warn});
  stop_on_signals(&signals, &worker);
  if (const absl::Status ended = worker.run(); !ended.ok()) return because("leaving " + config.server, ended);
  spdlog::info("left " + config.server);
  return absl::OkStatus();
}

}  // namespace

int main(int argc, char** argv) {
  if (argc == 2 && std::string_view(argv[1]) == "executor") return executor_main();
  ProgramOptions o;
  ExecutorConfig& config = o.config;
  config.threads = std::max(1u, std::thread::hardware_concurrency());
  config.cache_bytes = usable_memory() / 4;
  const Program program{
      .itself = {
          .name = "lightloom-worker",
          .help = "Bakes for a farm: joins a server, runs its tasks until SIGINT or SIGTERM, then finishes those "
                  "that it has; a second signal hands them back.",
          .options = {{"--server", "HOST:PORT of lightloom-server", &config.server, true},
                      {"--threads", "tasks at once", &config.threads},
                      {"--name", "letters, digits, dots, dashes, underscores; no two workers may share one", &o.name},
                      {"--cache", "memory for levels that are kept warm [a quarter of the memory]",
                       SizeOption{&config.cache_bytes}},
                      {"--memory", "memory that tasks may use, like 8G [0: no limit]",
                       SizeOption{&config.memory_bytes}},
                      {"--timeout", "seconds to wait for the server at the start", &o.timeout}},
          .check = [&] { return check(o); },
          .run = [&] { return work(o); }},
      .version = std::string(kVersion)};
  const Parsed parsed = parse_command_line(program, argc, argv);
  if (!parsed.command) return parsed.exit_code;

  spdlog::set_default_logger(spdlog::stderr_color_mt("lightloom-worker"));
  const absl::Status status = parsed.command->run();
  if (!status.ok()) spdlog::error(std::string(status.message()));
  return status.ok() ? 0 : kFailed;
}
