#include "bake-worker/child_process.h"

#include <signal.h>
#include <spawn.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>

#include "core/base/check.h"

namespace lightloom {

absl::StatusOr<std::unique_ptr<ChildProcess>> ChildProcess::start(const std::vector<std::string>& command) {
  int ends[2];
  if (::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, ends) != 0) {
    return absl::UnavailableError(std::string("cannot make a socket pair for the executor: ") + ::strerror(errno));
  }
  std::vector<char*> argv;
  for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
  argv.push_back(nullptr);

  // gRPC has threads by now: between fork and exec nothing may run but what posix_spawn does.
  posix_spawn_file_actions_t files;
  posix_spawnattr_t attributes;
  LL_CHECK(::posix_spawn_file_actions_init(&files) == 0 && ::posix_spawnattr_init(&attributes) == 0);
  ::posix_spawn_file_actions_adddup2(&files, ends[1], kChildSocket);
  ::posix_spawn_file_actions_addclosefrom_np(&files, kChildSocket + 1);
  sigset_t blocked;
  sigemptyset(&blocked);
  sigaddset(&blocked, SIGINT);
  sigaddset(&blocked, SIGTERM);
  ::posix_spawnattr_setsigmask(&attributes, &blocked);
  ::posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETSIGMASK);
  pid_t pid = -1;
  const int error = ::posix_spawn(&pid, argv.front(), &files, &attributes, argv.data(), environ);
  ::posix_spawnattr_destroy(&attributes);
  ::posix_spawn_file_actions_destroy(&files);
  ::close(ends[1]);
  if (error != 0) {
    ::close(ends[0]);
    return absl::UnavailableError("cannot start " + command.front() + ": " + ::strerror(error));
  }
  return std::unique_ptr<ChildProcess>(new ChildProcess(pid, ends[0]));
}

ChildProcess::~ChildProcess() {
  if (pid_ <= 0) return;
  kill();
  wait();
}

void ChildProcess::kill() {
  if (pid_ > 0) ::kill(pid_, SIGKILL);
}

ChildEnd ChildProcess::wait() {
  int status = 0;
  while (::waitpid(pid_, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = -1;
  if (WIFEXITED(status)) return {"exit code " + std::to_string(WEXITSTATUS(status))};
  if (WTERMSIG(status) == SIGKILL && group_.kills() > kills_before_) {
    return {"killed for lack of memory (cgroup limit)", true};
  }
  const char* name = ::sigabbrev_np(WTERMSIG(status));
  return {name != nullptr ? "SIG" + std::string(name) : "signal " + std::to_string(WTERMSIG(status))};
}

}  // namespace lightloom
