// Which lightloom this is, and which method its bakes follow.
#pragma once

#include <string_view>

namespace lightloom {

/// The release, from CMake's project(): for people and logs. Nothing decides by it.
extern const std::string_view kVersion;

/// Changes with any change that alters a stored byte of a bake. Part of every cache key and manifest; a
/// worker with another one is refused.
inline constexpr std::string_view kMethodVersion = "12";

}  // namespace lightloom
