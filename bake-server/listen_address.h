// Where a server may listen.
#pragma once

#include <string_view>

#include "core/base/status.h"

namespace lightloom {

/// OK if `address` is HOST:PORT with a loopback host (127.x.y.z, [::1] or localhost) and a port of 0 (any
/// free one) to 65535. Anything else is refused: connections are not encrypted or authenticated yet, so other
/// machines must not reach it.
absl::Status check_listen_address(std::string_view address);

}  // namespace lightloom
