#include "core/base/text.h"

#include <absl/strings/escaping.h>

namespace lightloom {

std::string printable(std::string_view text, size_t max) {
  const bool cut = text.size() > max;
  if (cut) {
    // Do not cut inside a UTF-8 sequence: its continuation bytes are 10xxxxxx.
    while (max > 0 && (static_cast<unsigned char>(text[max]) & 0xC0) == 0x80) --max;
    text = text.substr(0, max);
  }
  std::string escaped = absl::Utf8SafeCEscape(absl::string_view(text.data(), text.size()));
  if (cut) escaped += "...";
  return escaped;
}

std::string escape_controls(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte < 0x20 || byte == 0x7f) {
      out += absl::CEscape(absl::string_view(&c, 1));
    } else {
      out += c;
    }
  }
  return out;
}

}  // namespace lightloom
