#include "core/command_line/program.h"

#include <CLI/CLI.hpp>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <limits>
#include <sstream>
#include <string_view>

#include "core/base/parse_size.h"
#include "core/base/text.h"

namespace lightloom {
namespace {

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

/// Adds options to one command, each by its kind.
class Adder {
 public:
  Adder(CLI::App* app, const Option& option) : app_(app), option_(option) {}

  void operator()(bool* value) { app_->add_flag(option_.name, *value, option_.help); }
  void operator()(std::string* value) {
    app_->add_option(option_.name, *value, option_.help)->required(option_.required)->capture_default_str();
  }
  void operator()(std::vector<std::string>* value) {
    app_->add_option(option_.name, *value, option_.help)->required(option_.required);
  }
  void operator()(const SizeOption& value) { quantity(value.bytes, parse_size, value.preset, "SIZE"); }
  void operator()(const TimeOption& value) { quantity(value.seconds, parse_seconds, value.preset, "TIME"); }
  template <class Number>
  void operator()(std::optional<Number>* value) {
    number<Number>(value, "");
  }
  template <class Number>
  void operator()(Number* value) {
    std::ostringstream preset;
    preset << *value;
    number<Number>(value, preset.str());
  }

 private:
  /// Without its short form.
  std::string shown() const { return option_.name.substr(option_.name.find(',') + 1); }

  /// CLI11 would take 010 for 8, and nan for a number.
  template <class Number, class Value>
  void number(Value* value, const std::string& preset) {
    const auto set = [value, shown = shown()](const std::string& text) { *value = parse<Number>(shown, text); };
    text(set, preset, std::is_floating_point_v<Number> ? "FLOAT" : std::is_signed_v<Number> ? "INT" : "UINT");
  }

  template <class T>
  void quantity(T* value, absl::StatusOr<T> (*parse)(std::string_view), const std::string& preset, const char* type) {
    if (!preset.empty()) *value = parse(preset).value();
    const auto set = [value, parse, shown = shown()](const std::string& text) {
      const absl::StatusOr<T> parsed = parse(text);
      if (!parsed.ok()) throw CLI::ValidationError(shown, std::string(parsed.status().message()));
      *value = *parsed;
    };
    text(set, preset, type);
  }

  void text(const std::function<void(const std::string&)>& set, const std::string& preset, const char* type) {
    app_->add_option_function<std::string>(option_.name, set, option_.help)
        ->required(option_.required)
        ->type_name(type)
        ->default_str(preset);
  }

  CLI::App* app_;
  const Option& option_;
};

void add_options(CLI::App* app, const Command& command) {
  for (const Option& option : command.options) std::visit(Adder(app, option), option.value);
}

std::string names_of(const std::vector<Command>& commands) {
  std::string all;
  for (const Command& command : commands) all += (all.empty() ? "" : ", ") + command.name;
  return all;
}

/// The options of the program itself say nothing to its commands, and are required only without one.
void check_own_options(const CLI::App& app, const Command& itself) {
  const auto chosen = app.get_subcommands();
  if (chosen.empty()) {
    for (const Option& option : itself.options) {
      if (option.required && app.get_option(option.name)->count() == 0) throw CLI::RequiredError(option.name);
    }
    return;
  }
  const std::string command = chosen.front()->get_name();
  for (const CLI::Option* option : app.get_options()) {
    if (option->count() == 0) continue;
    throw CLI::ValidationError(option->get_name() + " before " + command,
                               "it is for " + itself.name + " alone: give the options of " + command + " after it");
  }
}

/// What CLI11 says, as one line.
int usage_error(const CLI::App& app, const Program& program, const CLI::ParseError& error, const char* first) {
  const std::string& name = program.itself.name;
  const auto see = [&](const std::string& command) { return "; see " + name + " " + command + "--help"; };
  const auto parsed = app.get_subcommands();
  if (!parsed.empty()) {
    const std::string& command = parsed.front()->get_name();
    return fail(name, command + ": " + error.what() + see(command + " "), kUsage);
  }
  if (program.itself.run) return fail(name, error.what() + see(""), kUsage);
  if (!first) return fail(name, "give a command: " + names_of(program.commands) + see(""), kUsage);
  return fail(name, "'" + printable(first) + "' is not a command; there are " + names_of(program.commands) + see(""),
              kUsage);
}

}  // namespace

int fail(const std::string& program, const std::string& message, int code) {
  std::fprintf(stderr, "%s: %s\n", program.c_str(), escape_controls(message).c_str());
  return code;
}

Parsed parse_command_line(const Program& program, int argc, char** argv) {
  const Command& itself = program.itself;
  CLI::App app(itself.help, itself.name);
  app.set_version_flag("--version", program.version);
  app.require_subcommand(itself.run ? 0 : 1, 1);
  Command own = itself;
  for (Option& option : own.options) option.required &= program.commands.empty();
  add_options(&app, own);
  const Command* chosen = &itself;
  for (const Command& command : program.commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.help);
    add_options(sub, command);
    sub->callback([&chosen, &command] { chosen = &command; });
  }
  try {
    app.parse(argc, argv);
    check_own_options(app, itself);
  } catch (const CLI::ParseError& error) {
    if (error.get_exit_code() == 0) return {nullptr, app.exit(error)};  // --help, --version
    return {nullptr, usage_error(app, program, error, argc > 1 ? argv[1] : nullptr)};
  }
  const absl::Status status = chosen->check ? chosen->check() : absl::OkStatus();
  if (status.ok()) return {chosen, 0};
  return {nullptr,
          fail(itself.name, std::string(status.message()), absl::IsInvalidArgument(status) ? kUsage : kFailed)};
}

}  // namespace lightloom
