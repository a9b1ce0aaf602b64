#include "cli/farm_command.h"

#include <charconv>
#include <chrono>
#include <string_view>
#include <utility>

#include "cli/interrupt.h"
#include "core/base/text.h"

namespace lightloom {

namespace {

/// "host:7000", "10.0.0.1:7000", "[::1]:7000". gRPC would take more, and guess a port.
bool is_host_and_port(std::string_view address) {
  const size_t colon = address.rfind(':');
  if (colon == std::string_view::npos || colon == 0) return false;
  const std::string_view host = address.substr(0, colon), digits = address.substr(colon + 1);
  const bool bracketed = host.size() > 2 && host.front() == '[' && host.back() == ']';
  if (!bracketed && host.find_first_of(":/[] \t") != std::string_view::npos) return false;
  uint16_t port = 0;
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), port);
  return error == std::errc() && end == digits.data() + digits.size() && port != 0;
}

}  // namespace

absl::Status FarmOptions::check() const {
  if (!is_host_and_port(server)) {
    return absl::InvalidArgumentError("--server '" + printable(server) + "' must be HOST:PORT, as in 127.0.0.1:7000");
  }
  if (timeout >= 1 && timeout <= 3600) return absl::OkStatus();
  return absl::InvalidArgumentError("--timeout must be 1 to 3600 seconds");
}

FarmClient FarmOptions::connect() const { return FarmClient(server, std::chrono::seconds(timeout), &interrupted()); }

Command farm_command(const std::string& name, const std::string& help, std::shared_ptr<FarmOptions> farm,
                     std::vector<Option> own, std::function<absl::Status()> run, std::function<absl::Status()> check) {
  own.push_back(farm->server_option());
  own.push_back(farm->timeout_option());
  own.push_back({"--json", "print it as JSON", &farm->json});
  return {name, help, std::move(own),
          [farm, check = std::move(check)] {
            LL_RETURN_IF_ERROR(farm->check());
            return check();
          },
          std::move(run)};
}

}  // namespace lightloom
