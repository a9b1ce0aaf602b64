// The `lightloom` program: reads the command line and runs one command.
//
// Exit codes: 0 done; 1 failed, and stderr has one line that says why; 2 the command line is at fault; 128 + signal
// stopped by it.
#include <CLI/CLI.hpp>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <new>
#include <vector>

#include "cli/command.h"
#include "cli/interrupt.h"
#include "core/base/text.h"
#include "core/base/version.h"

namespace lightloom {

absl::Status check_threads(int threads) {
  if (threads >= 0 && threads <= kMaxThreads) return absl::OkStatus();
  return absl::InvalidArgumentError("--threads must be 0 (one per hardware thread) to " + std::to_string(kMaxThreads));
}

namespace {

constexpr int kFailed = 1, kUsage = 2;

int fail(const std::string& message, int code) {
  std::fprintf(stderr, "lightloom: %s\n", escape_controls(message).c_str());
  return code;
}

template <class Number>
std::string expected() {
  if (std::is_floating_point_v<Number>) return "a finite number";
  return std::is_signed_v<Number> ? "a whole number from " + std::to_string(std::numeric_limits<Number>::min()) +
                                        " to " + std::to_string(std::numeric_limits<Number>::max())
                                  : "a whole number from 0 to " + std::to_string(std::numeric_limits<Number>::max());
}

template <class Number>
Number parse(const std::string& option, const std::string& text) {
  Number value{};
  const char* end = text.data() + text.size();
  const auto [at, error] = std::from_chars(text.data(), end, value);
  bool fits = error == std::errc() && at == end;
  if constexpr (std::is_floating_point_v<Number>) fits = fits && std::isfinite(value);
  if (!fits) {
    throw CLI::ValidationError(option + " '" + printable(text) + "' must be " + expected<Number>(),
                               CLI::ExitCodes::ValidationError);
  }
  return value;
}

void add_option(CLI::App* app, const Option& option) {
  std::visit(
      [&](auto* value) {
        using Value = std::remove_pointer_t<decltype(value)>;
        if constexpr (std::is_same_v<Value, bool>) {
          app->add_flag(option.name, *value, option.help);
        } else if constexpr (std::is_same_v<Value, std::string>) {
          app->add_option(option.name, *value, option.help)->required(option.required)->capture_default_str();
        } else {
          // CLI11 would take 010 for 8, and nan for a number.
          const std::string shown = option.name.substr(option.name.find(',') + 1);
          const auto set = [value, shown](const std::string& text) { *value = parse<Value>(shown, text); };
          std::ostringstream standard;
          standard << *value;
          app->add_option_function<std::string>(option.name, set, option.help)
              ->required(option.required)
              ->type_name(std::is_floating_point_v<Value> ? "FLOAT"
                          : std::is_signed_v<Value>       ? "INT"
                                                          : "UINT")
              ->default_str(standard.str());
        }
      },
      option.value);
}

std::string names_of(const std::vector<Command>& commands) {
  std::string all;
  for (const Command& command : commands) all += (all.empty() ? "" : ", ") + command.name;
  return all;
}

/// What CLI11 says, as one line.
int usage_error(const CLI::App& app, const std::vector<Command>& commands, const CLI::ParseError& error,
                const char* first) {
  const auto parsed = app.get_subcommands();
  if (!parsed.empty()) {
    const std::string& name = parsed.front()->get_name();
    return fail(name + ": " + error.what() + "; see lightloom " + name + " --help", kUsage);
  }
  if (!first) return fail("give a command: " + names_of(commands) + "; see lightloom --help", kUsage);
  return fail("'" + printable(first) + "' is not a command; there are " + names_of(commands) + "; see lightloom --help",
              kUsage);
}

int run_command(const Command& command) {
  if (const absl::Status status = command.check(); !status.ok()) {
    return fail(std::string(status.message()), absl::IsInvalidArgument(status) ? kUsage : kFailed);
  }
  const absl::Status status = command.run();
  if (status.ok()) return 0;
  const bool stopped = absl::IsCancelled(status) && interrupt_signal() != 0;
  return fail(std::string(status.message()), stopped ? 128 + interrupt_signal() : kFailed);
}

int run(int argc, char** argv) {
  CLI::App app("lightloom: bakes the light of a level so that it can be relit in real time", "lightloom");
  app.set_version_flag("--version", std::string(kVersion) + ", method " + std::string(kMethodVersion));
  app.require_subcommand(1);
  const std::vector<Command> commands = {
      bake_command(),    inspect_command(),    verify_command(),       render_command(),  reference_command(),
      compare_command(), make_scene_command(), submit_command(),       watch_command(),   list_command(),
      cancel_command(),  fetch_command(),      set_priority_command(), workers_command(), events_command()};
  const Command* chosen = nullptr;
  for (const Command& command : commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.help);
    for (const Option& option : command.options) add_option(sub, option);
    sub->callback([&chosen, &command] { chosen = &command; });
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return app.exit(error);  // --help, --version
    return usage_error(app, commands, error, argc > 1 ? argv[1] : nullptr);
  }
  return run_command(*chosen);
}

}  // namespace
}  // namespace lightloom

int main(int argc, char** argv) {
  using namespace lightloom;
  int code = kFailed;
  try {
    code = run(argc, argv);
  } catch (const std::bad_alloc&) {
    return fail("not enough memory; lower the resolution or --threads, or free some", kFailed);
  } catch (const std::exception& error) {
    return fail(std::string("this is a bug, please report it: ") + error.what(), kFailed);
  }
  // Results that never arrived are no success.
  if ((std::fflush(stdout) != 0 || std::ferror(stdout) != 0) && code == 0) {
    return fail("cannot write to the standard output; free space where it goes", kFailed);
  }
  return code;
}
