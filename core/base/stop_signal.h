// SIGINT and SIGTERM, waited for instead of handled.
#pragma once

#include <csignal>

namespace lightloom {

/// Holds back SIGINT and SIGTERM from the time it is made. Make it first in main(): threads inherit what is
/// blocked.
class StopSignal {
 public:
  StopSignal();
  /// Returns when one arrives: which one.
  int wait();

 private:
  sigset_t signals_{};
};

}  // namespace lightloom
