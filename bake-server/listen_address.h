// Where a server may listen.
#pragma once

#include <string_view>

#include "core/base/status.h"

namespace lightloom {

/// OK if `address` is HOST:PORT with a port of 0 (any free one) to 65535, and a loopback host (127.x.y.z, [::1] or
/// localhost): connections are not encrypted or authenticated yet, so other machines must not reach it. With `insecure`
/// any host will do.
absl::Status check_listen_address(std::string_view address, bool insecure = false);

}  // namespace lightloom
