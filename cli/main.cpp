// The `lightloom` program: reads the command line and runs one command.
#include <CLI/CLI.hpp>

#include <cstdio>
#include <vector>

#include "cli/command.h"
#include "cli/interrupt.h"
#include "core/base/version.h"

namespace {

void add_option(CLI::App* app, const lightloom::Option& option) {
  std::visit(
      [&](auto* value) {
        if constexpr (std::is_same_v<decltype(value), bool*>) {
          app->add_flag(option.name, *value, option.help);
        } else {
          app->add_option(option.name, *value, option.help)->required(option.required)->capture_default_str();
        }
      },
      option.value);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace lightloom;
  CLI::App app("lightloom: bakes the light of a level so that it can be relit in real time", "lightloom");
  app.set_version_flag("--version", std::string(kVersion) + ", method " + std::string(kMethodVersion));
  app.require_subcommand(1);

  const std::vector<Command> commands = {bake_command(),      inspect_command(), verify_command(),    render_command(),
                                         reference_command(), compare_command(), make_scene_command()};
  absl::Status status;
  for (const Command& command : commands) {
    CLI::App* sub = app.add_subcommand(command.name, command.help);
    for (const Option& option : command.options) add_option(sub, option);
    sub->callback([&status, &command] { status = command.run(); });
  }
  cancel_on_interrupt();
  CLI11_PARSE(app, argc, argv);
  if (status.ok()) return 0;
  std::fprintf(stderr, "lightloom: %s\n", std::string(status.message()).c_str());
  return status.code() == absl::StatusCode::kInvalidArgument ? 2 : 1;
}
