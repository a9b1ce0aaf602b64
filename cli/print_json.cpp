#include "cli/print_json.h"

#include <cstdio>
#include <nlohmann/json.hpp>

namespace lightloom {

void print_json(const nlohmann::json& value) {
  std::printf("%s\n", value.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace).c_str());
}

}  // namespace lightloom
