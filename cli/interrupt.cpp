#include "cli/interrupt.h"

#include <unistd.h>

#include <csignal>
#include <string_view>

namespace lightloom {
namespace {

CancelFlag flag;
volatile std::sig_atomic_t received = 0;
bool on_terminal = false;

void handle(int signal) {
  received = signal;
  flag.cancel();
  struct sigaction standard {};
  standard.sa_handler = SIG_DFL;
  ::sigaction(SIGINT, &standard, nullptr);
  ::sigaction(SIGTERM, &standard, nullptr);
  // Some steps cannot stop halfway: say that the key was seen.
  if (on_terminal) {
    constexpr std::string_view kText = "\nstopping after this step; Ctrl-C again stops at once\n";
    [[maybe_unused]] const ssize_t ignored = ::write(STDERR_FILENO, kText.data(), kText.size());
  }
}

}  // namespace

void cancel_on_interrupt() {
  on_terminal = ::isatty(STDERR_FILENO) == 1;
  struct sigaction action {};
  action.sa_handler = handle;  // without SA_RESTART: what waits shall return
  ::sigaction(SIGINT, &action, nullptr);
  ::sigaction(SIGTERM, &action, nullptr);
}

const CancelFlag& interrupted() { return flag; }

int interrupt_signal() { return received; }

absl::Status not_interrupted() {
  return flag.cancelled() ? absl::CancelledError("cancelled; nothing more is written") : absl::OkStatus();
}

}  // namespace lightloom
