// Text from outside, made fit for one line of a log or an error message.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace lightloom {

/// `text` with control characters and quotes escaped (C style, UTF-8 kept), cut to about `max` bytes with
/// "..." at the cut.
std::string printable(std::string_view text, size_t max = 120);

/// `text` whole, on one line: control characters escaped (C style), all else kept.
std::string escape_controls(std::string_view text);

}  // namespace lightloom
