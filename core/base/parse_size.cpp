#include "core/base/parse_size.h"

#include <absl/strings/str_cat.h>

#include <charconv>
#include <cmath>
#include <cstdio>
#include <optional>

#include "core/base/text.h"

namespace lightloom {
namespace {

/// A number that is not negative, as digits with at most one point; the rest of `text` is left there.
std::optional<double> take_number(std::string_view* text) {
  double number = 0;
  if (text->empty() || (text->front() != '.' && (text->front() < '0' || text->front() > '9'))) return std::nullopt;
  const auto [end, error] =
      std::from_chars(text->data(), text->data() + text->size(), number, std::chars_format::fixed);
  if (error != std::errc()) return std::nullopt;
  text->remove_prefix(static_cast<size_t>(end - text->data()));
  return number;
}

}  // namespace

absl::StatusOr<uint64_t> parse_size(std::string_view text) {
  std::string_view rest = text;
  const std::optional<double> number = take_number(&rest);
  if (rest.size() > 1 && rest.front() != 'B' && (rest.substr(1) == "B" || rest.substr(1) == "iB")) {
    rest.remove_suffix(rest.size() - 1);  // 5MB and 5MiB are 5M
  }
  const size_t power = rest.empty() ? 0 : std::string_view("BKMGT").find(rest.front());
  if (number && rest.size() <= 1 && power != std::string_view::npos) {
    const double bytes = std::floor(*number * std::ldexp(1.0, static_cast<int>(10 * power)));
    if (bytes < 0x1p63) return static_cast<uint64_t>(bytes);
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", printable(text), "' is no size: give a number with K, M, G or T, as in 500M or 20G"));
}

absl::StatusOr<int64_t> parse_seconds(std::string_view text) {
  std::string_view rest = text;
  const std::optional<double> number = take_number(&rest);
  constexpr std::string_view kUnits = "smhd";
  constexpr double kSeconds[] = {1, 60, 3600, 86'400};
  const size_t unit = rest.empty() ? 0 : kUnits.find(rest.front());
  if (number && rest.size() <= 1 && unit != std::string_view::npos) {
    const double seconds = std::floor(*number * kSeconds[unit]);
    if (seconds < 1e12) return static_cast<int64_t>(seconds);  // in milliseconds, too, it is a number of 64 bits
  }
  return absl::InvalidArgumentError(
      absl::StrCat("'", printable(text), "' is no time: give seconds, or a number with m, h or d, as in 12h or 30d"));
}

std::string size_text(uint64_t bytes) {
  constexpr const char* kUnits[] = {"B", "KiB", "MiB", "GiB", "TiB"};
  if (bytes < 1024) return absl::StrCat(bytes, " B");
  double size = static_cast<double>(bytes);
  size_t unit = 0;
  for (; size >= 1024 && unit < 4; ++unit) size /= 1024;
  char text[32];
  std::snprintf(text, sizeof text, "%.1f %s", size, kUnits[unit]);
  return text;
}

}  // namespace lightloom
