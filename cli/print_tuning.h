// What was chosen for a bake, and why.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "core/tuning/tune.h"

namespace lightloom {

nlohmann::json to_json(const Tuning& tuning);
void print(const Tuning& tuning);

}  // namespace lightloom
