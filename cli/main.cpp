// The `lightloom` program: reads the command line and runs one command.
//
// Exit codes: 0 done; 1 failed, and stderr has one line that says why; 2 the command line is at fault; 128 + signal
// stopped by it.
#include <cstdio>
#include <exception>
#include <new>
#include <string>

#include "cli/command.h"
#include "cli/interrupt.h"
#include "core/base/version.h"

namespace lightloom {

absl::Status check_threads(int threads) {
  if (threads >= 0 && threads <= kMaxThreads) return absl::OkStatus();
  return absl::InvalidArgumentError("--threads must be 0 (one per hardware thread) to " + std::to_string(kMaxThreads));
}

namespace {

int fail(const std::string& message, int code = kFailed) { return lightloom::fail("lightloom", message, code); }

int run(int argc, char** argv) {
  const Program program{
      .itself = {.name = "lightloom",
                 .help = "lightloom: bakes the light of a level so that it can be relit in real time"},
      .version = std::string(kVersion) + ", method " + std::string(kMethodVersion),
      .commands = {bake_command(), inspect_command(), verify_command(), render_command(), view_command(),
                   reference_command(), compare_command(), eval_command(), make_scene_command(), submit_command(),
                   watch_command(), list_command(), cancel_command(), fetch_command(), set_priority_command(),
                   workers_command(), events_command()}};
  const Parsed parsed = parse_command_line(program, argc, argv);
  if (!parsed.command) return parsed.exit_code;
  const absl::Status status = parsed.command->run();
  if (status.ok()) return 0;
  const bool stopped = absl::IsCancelled(status) && interrupt_signal() != 0;
  return fail(std::string(status.message()), stopped ? 128 + interrupt_signal() : kFailed);
}

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) {
  using namespace lightloom;
  int code = kFailed;
  try {
    code = run(argc, argv);
  } catch (const std::bad_alloc&) {
    return fail("not enough memory; lower the resolution or --threads, or free some");
  } catch (const std::exception& error) {
    return fail(std::string("this is a bug, please report it: ") + error.what());
  }
  // Results that never arrived are no success.
  if ((std::fflush(stdout) != 0 || std::ferror(stdout) != 0) && code == 0) {
    return fail("cannot write to the standard output; free space where it goes");
  }
  return code;
}
