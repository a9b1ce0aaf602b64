// Names that nobody else chooses.
#pragma once

#include <string>

namespace lightloom {

/// 128 bits from the system's source of randomness, as 32 lower-case hexadecimal digits. Thread-safe.
std::string random_id();

}  // namespace lightloom
