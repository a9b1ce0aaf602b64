// A command's result for programs.
#pragma once

#include <nlohmann/json_fwd.hpp>

namespace lightloom {

/// One line on stdout. Names from files need not be UTF-8: bytes that are not become U+FFFD. Numbers that JSON has no word
/// for (the PSNR of equal images) are null.
void print_json(const nlohmann::json& value);

}  // namespace lightloom
