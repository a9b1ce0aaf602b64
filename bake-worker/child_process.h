// A program of ours that runs beside this one and ends with it.
#pragma once

#include <sys/types.h>

#include <memory>
#include <string>
#include <vector>

#include "bake-worker/frames.h"
#include "bake-worker/memory_limits.h"
#include "core/base/status.h"

namespace lightloom {

/// The child's descriptor of the socket to this process.
inline constexpr int kChildSocket = 3;

/// How a process ended.
struct ChildEnd {
  std::string how;  ///< "SIGSEGV", "exit code 3", "killed for lack of memory (cgroup limit)"
  bool of_memory = false;
};

/// Killed and waited for at the end.
class ChildProcess {
 public:
  /// Starts `command`, its program first (a path). The child inherits no other descriptor than the standard ones and
  /// kChildSocket, and SIGINT and SIGTERM are blocked in it: a terminal sends them to both, and this process decides.
  static absl::StatusOr<std::unique_ptr<ChildProcess>> start(const std::vector<std::string>& command);
  ~ChildProcess();
  ChildProcess(const ChildProcess&) = delete;
  ChildProcess& operator=(const ChildProcess&) = delete;

  pid_t pid() const { return pid_; }
  Frames& frames() { return frames_; }
  /// SIGKILL. Any thread, but not while or after wait() is called.
  void kill();
  /// Waits for its end. Called once.
  ChildEnd wait();

 private:
  ChildProcess(pid_t pid, int socket) : pid_(pid), frames_(socket) {}

  pid_t pid_;
  Frames frames_;
  const MemoryGroup group_;
  const uint64_t kills_before_ = group_.kills();
};

}  // namespace lightloom
