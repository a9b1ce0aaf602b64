// The subcommands of `lightloom`.
#pragma once

#include "core/command_line/program.h"

namespace lightloom {

inline constexpr int kMaxThreads = 1024;

Command bake_command();
Command cancel_command();
Command compare_command();
Command eval_command();
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
Command view_command();
Command watch_command();
Command workers_command();

/// Shared by the commands that have the option.
absl::Status check_threads(int threads);

}  // namespace lightloom
