// Ctrl-C stops long commands in good order.
#pragma once

#include "core/base/parallel.h"

namespace lightloom {

/// Set by SIGINT and SIGTERM once cancel_on_interrupt() was called.
const CancelFlag& interrupted();
void cancel_on_interrupt();

}  // namespace lightloom
