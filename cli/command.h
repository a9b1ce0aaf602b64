// A subcommand of `lightloom` as data: one table of options makes both its parsing and its help.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "core/base/status.h"

namespace lightloom {

inline constexpr int kMaxThreads = 1024;

struct Option {
  std::string name;  ///< "SCENE" positional, "-o,--output" or "--bounces"
  std::string help;
  /// Holds the default; bool: a flag. Numbers are parsed whole, and are finite.
  std::variant<bool*, int*, uint64_t*, float*, std::string*> value;
  bool required = false;
};

struct Command {
  std::string name;
  std::string help;
  std::vector<Option> options;
  /// What can be said before any work: values in range, inputs there, outputs writable. InvalidArgument: the command line
  /// is at fault.
  std::function<absl::Status()> check;
  std::function<absl::Status()> run;
};

Command bake_command();
Command cancel_command();
Command compare_command();
Command events_command();
Command fetch_command();
Command inspect_command();
Command list_command();
Command make_scene_command();
Command reference_command();
Command render_command();
Command set_priority_command();
Command submit_command();
Command verify_command();
Command watch_command();
Command workers_command();

/// Shared by the commands that have the option.
absl::Status check_threads(int threads);

}  // namespace lightloom
