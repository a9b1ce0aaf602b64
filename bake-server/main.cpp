// lightloom-server: the coordinator of a bake farm.
#include <spdlog/sinks/stdout_color_sinks.h>
#include <spdlog/spdlog.h>

#include <csignal>
#include <string>

#include "bake-server/commands/commands.h"
#include "bake-server/upkeep/backup.h"
#include "core/base/version.h"
#include "core/command_line/program.h"

namespace {

using namespace lightloom;

CancelFlag cancelled;

void cancel_on_signals() {
  for (const int signal : {SIGINT, SIGTERM}) std::signal(signal, [](int) { cancelled.cancel(); });
}

}  // namespace

int main(int argc, char** argv) {
  ServeOptions serving;
  auto& upkeep = serving.limits.upkeep.emplace();
  std::string from, to, database;
  int64_t grace = 0;
  bool dry_run = false;
  const Option state_of_another{"--state", "the server's folder", &from, true};
  const Option database_of_another{"--database", "the server's, if it has one", &database};
  const Program program{
      .itself =
          {.name = "lightloom-server",
           .help = "Coordinates a bake farm: takes jobs, hands their tasks to workers, keeps what they give.",
           .options =
               {{"--listen", "HOST:PORT to listen on; port 0 takes a free one", &serving.listen},
                {"--insecure", "listen on other than loopback addresses too, without TLS", &serving.insecure},
                {"--state", "folder for jobs and blobs; made if it is not there", &serving.state, true},
                {"--database",
                 "PostgreSQL address (postgresql://…) for jobs; other servers may share it and the folder's blobs",
                 &serving.database},
                {"--retain", "how long ended jobs are kept; 0: for ever", TimeOption{&upkeep.retain_seconds, "30d"}},
                {"--grace", "how long blobs are kept that no job names", TimeOption{&upkeep.grace_seconds, "1h"}},
                {"--min-free", "while the state's disk has less, uploads are refused and no tasks given out",
                 SizeOption{&serving.limits.min_free, "1G"}},
                {"--quota", "what one client's jobs may keep; 0: any", SizeOption{&serving.limits.quota, "0"}}},
           .run = [&] { return serve(serving); }},
      .version = std::string(kVersion),
      .commands = {{.name = "gc",
                    .help = "Removes blobs that no job names, also beside a running server.",
                    .options = {state_of_another,
                                database_of_another,
                                {"--grace", "younger ones stay", TimeOption{&grace, "1h"}},
                                {"--dry-run", "only say what would go", &dry_run}},
                    .run =
                        [&] {
                          cancel_on_signals();
                          return gc(from, database, grace, dry_run, cancelled);
                        }},
                   {.name = "backup",
                    .help = "Copies a state folder, also beside a running server.",
                    .options = {state_of_another,
                                database_of_another,
                                {"--to", "the copy: a new folder, best on the same disk (hard links), then carried off",
                                 &to, true}},
                    .run =
                        [&] {
                          cancel_on_signals();
                          return backup(from, database, to, cancelled);
                        }},
                   {.name = "restore",
                    .help = "Puts the jobs of a backup into an empty database; its folder is then a server's --state.",
                    .options = {{"--from", "the backup", &from, true},
                                {"--database", "PostgreSQL address (postgresql://…)", &database, true}},
                    .run = [&] { return restore(from, database); }}}};
  const Parsed parsed = parse_command_line(program, argc, argv);
  if (!parsed.command) return parsed.exit_code;

  spdlog::set_default_logger(spdlog::stderr_color_mt("lightloom-server"));
  const absl::Status status = parsed.command->run();
  if (!status.ok()) spdlog::error(std::string(status.message()));
  return status.ok() ? 0 : kFailed;
}
