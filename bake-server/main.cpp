// lightloom-server: the coordinator of a bake farm.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <string>

#include "bake-server/commands/commands.h"
#include "core/base/parse_size.h"
#include "core/base/text.h"
#include "core/base/version.h"

namespace {

lightloom::CancelFlag cancelled;

/// An option that parse_size() or parse_seconds() reads.
template <class T>
void add_quantity(CLI::App* app, const std::string& name, T* value, absl::StatusOr<T> (*parse)(std::string_view),
                  const std::string& preset, const std::string& help) {
  *value = parse(preset).value();
  const auto read = [=](const CLI::results_t& given) {
    const absl::StatusOr<T> parsed = parse(given.at(0));
    if (!parsed.ok()) throw CLI::ValidationError(name, std::string(parsed.status().message()));
    *value = *parsed;
    return true;
  };
  app->add_option(name, read, help)->default_str(preset);
}

/// Which command is meant; a server's options say nothing to the others.
void check_command(const CLI::App& app, const lightloom::ServeOptions& serving) {
  if (app.get_subcommands().empty()) {
    if (serving.state.empty()) throw CLI::RequiredError("--state");
    return;
  }
  const std::string command = app.get_subcommands().front()->get_name();
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() == 0) continue;
    throw CLI::ValidationError(option->get_name() + " before " + command,
                               "it is for serving: give the options of " + command + " after it");
  }
}

/// What CLI11 says, as one line.
int usage_error(const CLI::App& app, const CLI::ParseError& error) {
  const auto commands = app.get_subcommands();
  const std::string command = commands.empty() ? "" : commands.front()->get_name() + " ";
  std::fprintf(stderr, "lightloom-server: %s; see lightloom-server %s--help\n",
               lightloom::escape_controls(error.what()).c_str(), command.c_str());
  return 2;
}

}  // namespace

int main(int argc, char** argv) {
  using lightloom::parse_seconds, lightloom::parse_size;
  CLI::App app{"Coordinates a bake farm: takes jobs, hands their tasks to workers, keeps what they give."};
  lightloom::ServeOptions serving;
  auto& upkeep = serving.limits.upkeep.emplace();
  std::string from, to;
  int64_t grace = 0;
  bool dry_run = false;
  app.add_option("--listen", serving.listen, "HOST:PORT to listen on; port 0 takes a free one")->capture_default_str();
  app.add_flag("--insecure", serving.insecure, "listen on other than loopback addresses too, without TLS");
  app.add_option("--state", serving.state, "folder for jobs and blobs; made if it is not there");
  add_quantity(&app, "--retain", &upkeep.retain_seconds, parse_seconds, "30d",
               "how long ended jobs are kept; 0: for ever");
  add_quantity(&app, "--grace", &upkeep.grace_seconds, parse_seconds, "1h",
               "how long blobs are kept that no job names");
  add_quantity(&app, "--min-free", &serving.limits.min_free, parse_size, "1G",
               "while the state's disk has less, uploads are refused and no tasks given out");
  add_quantity(&app, "--quota", &serving.limits.quota, parse_size, "0", "what one client's jobs may keep; 0: any");
  app.set_version_flag("--version", std::string(lightloom::kVersion));
  app.require_subcommand(0, 1);

  auto* gc = app.add_subcommand("gc", "Removes blobs that no job names, also beside a running server.");
  gc->add_option("--state", from, "the server's folder")->required();
  add_quantity(gc, "--grace", &grace, parse_seconds, "1h", "younger ones stay");
  gc->add_flag("--dry-run", dry_run, "only say what would go");
  auto* backup = app.add_subcommand("backup", "Copies a state folder, also beside a running server.");
  backup->add_option("--state", from, "the server's folder")->required();
  backup->add_option("--to", to, "the copy: a new folder, best on the same disk (hard links), then carried off")
      ->required();
  try {
    app.parse(argc, argv);
    check_command(app, serving);
  } catch (const CLI::ParseError& error) {
    return error.get_exit_code() == 0 ? app.exit(error) : usage_error(app, error);
  }

  spdlog::set_default_logger(spdlog::stderr_color_mt("lightloom-server"));
  if (*gc || *backup) {
    for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { cancelled.cancel(); });
  }
  const absl::Status status = *gc       ? lightloom::gc(from, grace, dry_run, cancelled)
                              : *backup ? lightloom::backup(from, to, cancelled)
                                        : lightloom::serve(serving);
  if (!status.ok()) spdlog::error("{}", std::string(status.message()));
  return status.ok() ? 0 : 1;
}
