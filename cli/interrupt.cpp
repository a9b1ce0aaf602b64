#include "cli/interrupt.h"

#include <csignal>

namespace lightloom {
namespace {

CancelFlag flag;

}  // namespace

const CancelFlag& interrupted() { return flag; }

void cancel_on_interrupt() {
  // A second signal ends the process at once.
  const auto handler = [](int signal) {
    flag.cancel();
    std::signal(signal, SIG_DFL);
  };
  std::signal(SIGINT, handler);
  std::signal(SIGTERM, handler);
}

}  // namespace lightloom
