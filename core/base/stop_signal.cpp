#include "core/base/stop_signal.h"

#include "core/base/check.h"

namespace lightloom {

StopSignal::StopSignal() {
  sigemptyset(&signals_);
  sigaddset(&signals_, SIGINT);
  sigaddset(&signals_, SIGTERM);
  LL_CHECK(pthread_sigmask(SIG_BLOCK, &signals_, nullptr) == 0);
}

int StopSignal::wait() {
  int signal = 0;
  LL_CHECK(sigwait(&signals_, &signal) == 0);
  return signal;
}

}  // namespace lightloom
