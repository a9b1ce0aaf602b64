// The version of the messages in this folder.
#pragma once

#include <cstdint>

namespace lightloom {

/// Raised when a peer that does not know a change would misunderstand. Servers accept this one and the one
/// before.
inline constexpr uint32_t kProtocolVersion = 1;

}  // namespace lightloom
