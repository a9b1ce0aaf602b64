// A subcommand of `lightloom` as data: one table of options makes both its parsing and its help.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <variant>
#include <vector>

#include "core/base/status.h"

namespace lightloom {

struct Option {
  std::string name;  ///< "SCENE" positional, "-o,--output" or "--bounces"
  std::string help;
  std::variant<bool*, int*, uint64_t*, float*, std::string*> value;  ///< holds the default; bool: a flag
  bool required = false;
};

struct Command {
  std::string name;
  std::string help;
  std::vector<Option> options;
  std::function<absl::Status()> run;
};

Command bake_command();
Command compare_command();
Command inspect_command();
Command make_scene_command();
Command reference_command();
Command render_command();
Command verify_command();

}  // namespace lightloom
