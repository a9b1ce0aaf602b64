// Counts what operator new is asked for in the program that this is linked into.
#pragma once

#include <cstdint>

namespace lightloom::testing {

/// Calls since the program began, of all threads.
uint64_t allocations();

}  // namespace lightloom::testing
