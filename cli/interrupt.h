// Ctrl-C stops long commands in good order.
#pragma once

#include "core/base/parallel.h"
#include "core/base/status.h"

namespace lightloom {

/// From now on the first SIGINT or SIGTERM sets interrupted(); a second one ends the process at once, as without this.
/// For commands that look at the flag.
void cancel_on_interrupt();

const CancelFlag& interrupted();
/// The signal that came, or 0.
int interrupt_signal();
/// An error once interrupted: between the steps of a command.
absl::Status not_interrupted();

}  // namespace lightloom
