#include "bake-server/listen_address.h"

#include <absl/strings/str_cat.h>
#include <arpa/inet.h>

#include <charconv>
#include <string>

#include "core/base/text.h"

namespace lightloom {

namespace {

bool is_port(std::string_view text) {
  uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  return error == std::errc() && end == text.data() + text.size();
}

bool is_loopback(const std::string& host) {
  in_addr v4{};
  if (inet_pton(AF_INET, host.c_str(), &v4) == 1) return (ntohl(v4.s_addr) >> 24) == 127;
  return host == "localhost" || host == "[::1]";
}

}  // namespace

absl::Status check_listen_address(std::string_view address, bool insecure) {
  const size_t colon = address.rfind(':');
  if (colon == std::string_view::npos || colon == 0 || !is_port(address.substr(colon + 1))) {
    return absl::InvalidArgumentError(absl::StrCat(
        "'", printable(address), "' is not an address to listen on: give HOST:PORT, as in 127.0.0.1:7000"));
  }
  if (!insecure && !is_loopback(std::string(address.substr(0, colon)))) {
    return absl::InvalidArgumentError(
        absl::StrCat("cannot listen on '", printable(address),
                     "': connections have no TLS yet, so only this machine may connect: use 127.0.0.1:PORT, or give "
                     "--insecure if everyone on that network may read and change all jobs"));
  }
  return absl::OkStatus();
}

}  // namespace lightloom
