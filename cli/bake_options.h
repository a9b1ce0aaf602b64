// The options that say how a level is baked, for all commands that bake.
#pragma once

#include <string>
#include <vector>

#include "cli/command.h"
#include "core/bake/plan.h"

namespace lightloom {

struct BakeOptions {
  std::string method = "default";
  BakeParams params;
  int links = -1, relight_rays = -1;  // −1: the method's
  float threshold = -1;

  std::vector<Option> options();
  /// Fills in what the method chooses, and checks it all.
  absl::Status check();
};

}  // namespace lightloom
