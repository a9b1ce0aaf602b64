// A program that runs beside a test.
#pragma once

#include <fcntl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <functional>
#include <string>
#include <vector>

#include "core/base/check.h"

namespace lightloom::test {

/// Killed with the object, if it still runs. Not thread-safe.
class Process {
 public:
  /// What it writes to stdout and stderr is read here.
  explicit Process(const std::vector<std::string>& command) {
    std::vector<char*> argv;
    for (const std::string& word : command) argv.push_back(const_cast<char*>(word.c_str()));
    argv.push_back(nullptr);
    int ends[2];
    LL_CHECK(::pipe2(ends, O_CLOEXEC) == 0);
    pid_ = ::fork();
    if (pid_ == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::dup2(ends[1], STDERR_FILENO);
      ::execv(argv[0], argv.data());
      ::_exit(127);
    }
    LL_CHECK(pid_ > 0);
    ::close(ends[1]);
    from_ = ends[0];
  }
  ~Process() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      ::waitpid(pid_, nullptr, 0);
    }
    ::close(from_);
  }
  Process(const Process&) = delete;
  Process& operator=(const Process&) = delete;

  pid_t pid() const { return pid_; }
  /// All that was read so far.
  const std::string& output() const { return output_; }

  /// Waits for a line that `is_it`, and returns it; empty if the program ended without one.
  std::string line(const std::function<bool(const std::string&)>& is_it) {
    for (;;) {
      for (size_t end; (end = output_.find('\n', seen_)) != std::string::npos;) {
        const std::string line = output_.substr(seen_, end - seen_);
        seen_ = end + 1;
        if (is_it(line)) return line;
      }
      if (!read_more()) return "";
    }
  }
  std::string line_with(const std::string& what) {
    return line([&](const std::string& line) { return line.find(what) != std::string::npos; });
  }

  void signal(int number) const {
    LL_CHECK(pid_ > 0);  // -1 would be everybody
    ::kill(pid_, number);
  }
  /// Until it ends by itself: its exit code, or -signal.
  int wait() {
    while (read_more()) {
    }
    int status = 0;
    LL_CHECK(::waitpid(pid_, &status, 0) == pid_);
    pid_ = -1;
    return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
  }
  int stop(int number) {
    signal(number);
    return wait();
  }

 private:
  bool read_more() {
    char bytes[4096];
    ssize_t n;
    do n = ::read(from_, bytes, sizeof bytes);
    while (n < 0 && errno == EINTR);
    if (n > 0) output_.append(bytes, static_cast<size_t>(n));
    return n > 0;
  }

  pid_t pid_ = -1;
  int from_ = -1;
  std::string output_;
  size_t seen_ = 0;  // of the output, by line()
};

}  // namespace lightloom::test
