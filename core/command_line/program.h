// A program's command line as data: one table of options makes both its parsing and its help.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "core/base/status.h"

namespace lightloom {

/// As parse_size() reads it.
struct SizeOption {
  uint64_t* bytes;
  std::string preset = "";  ///< empty: what *bytes holds, and the help says it
};

/// As parse_seconds() reads it.
struct TimeOption {
  int64_t* seconds;
  std::string preset;
};

struct Option {
  std::string name;  ///< "SCENE" positional, "-o,--output" or "--bounces"
  std::string help;
  /// Holds the default; bool: a flag; vector: one or more, up to the next option; optional: may be left out, and the help says what that means. Numbers are parsed
  /// whole, and are finite.
  std::variant<bool*, int*, uint32_t*, uint64_t*, float*, std::string*, std::vector<std::string>*, std::optional<int>*,
               std::optional<uint64_t>*, std::optional<float>*, SizeOption, TimeOption>
      value;
  bool required = false;
};

struct Command {
  std::string name;
  std::string help;
  std::vector<Option> options = {};
  /// What can be said before any work: values in range, inputs there, outputs writable. InvalidArgument: the command line
  /// is at fault. Empty: nothing.
  std::function<absl::Status()> check = {};
  /// Empty: a command of a program must be named.
  std::function<absl::Status()> run = {};
};

struct Program {
  Command itself;  ///< what it does without a command; its options are for that alone
  std::string version;
  std::vector<Command> commands = {};
};

/// Exit codes of every program.
inline constexpr int kFailed = 1, kUsage = 2;

/// Prints "<program>: <message>" as one line on stderr and returns the code.
int fail(const std::string& program, const std::string& message, int code);

struct Parsed {
  const Command* command = nullptr;  ///< of the program given: checked, to be run
  int exit_code = 0;                 ///< without one: everything has been said
};
Parsed parse_command_line(const Program& program, int argc, char** argv);

}  // namespace lightloom
