#include "cli/view/child_bake.h"

#include <fcntl.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <csignal>
#include <cstring>
#include <sstream>
#include <string_view>
#include <vector>

namespace lightloom::view {
namespace {

constexpr std::string_view kItself = "lightloom: ";
constexpr int kNicer = 5;  // than the window, which is to stay alive

/// stdout goes nowhere, stderr to `to`.
int spawn(pid_t* child, std::vector<std::string> command, int to) {
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
  posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, "/dev/null", O_WRONLY, 0);
  posix_spawn_file_actions_adddup2(&actions, to, STDERR_FILENO);
  std::vector<char*> argv;
  argv.reserve(command.size() + 1);
  for (std::string& word : command) argv.push_back(word.data());
  argv.push_back(nullptr);
  const int error = ::posix_spawn(child, argv[0], &actions, nullptr, argv.data(), environ);
  posix_spawn_file_actions_destroy(&actions);
  return error;
}

}  // namespace

bool parse_progress(const std::string& line, BakeProgress* progress) {
  std::istringstream in(line);
  std::string word;
  BakeProgress read;
  if (!(in >> word) || word != "progress") return false;
  // The stage may be several words: the numbers are the last two.
  std::vector<std::string> words;
  while (in >> word) words.push_back(word);
  if (words.size() < 3) return false;
  std::istringstream numbers(words[words.size() - 2] + " " + words.back());
  if (!(numbers >> read.done >> read.total)) return false;
  for (size_t i = 0; i + 2 < words.size(); ++i) read.stage += (i == 0 ? "" : " ") + words[i];
  *progress = read;
  return true;
}

ChildBake::~ChildBake() {
  if (!running()) return;
  // At once: what is done is on disk already, and the next bake goes on from there.
  ::kill(child_, SIGKILL);
  ::waitpid(child_, nullptr, 0);
  ::close(from_);
}

absl::Status ChildBake::start(const std::string& program, const std::string& scene, const std::string& loom) {
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC | O_NONBLOCK) != 0) {
    return absl::UnavailableError(std::string("cannot start the bake: ") + std::strerror(errno));
  }
  const int error = spawn(&child_, {program, "bake", scene, "-o", loom, "--progress"}, ends[1]);
  ::close(ends[1]);
  if (error != 0) {
    ::close(ends[0]);
    child_ = -1;
    return absl::UnavailableError(std::string("cannot start the bake: ") + std::strerror(error));
  }
  ::setpriority(PRIO_PROCESS, static_cast<id_t>(child_), kNicer);
  from_ = ends[0];
  cancelled_ = false;
  partial_.clear();
  last_line_.clear();
  progress_ = {"starting", 0, 0};
  return absl::OkStatus();
}

void ChildBake::take(const char* bytes, size_t size) {
  partial_.append(bytes, size);
  for (size_t end; (end = partial_.find('\n')) != std::string::npos; partial_.erase(0, end + 1)) {
    std::string line = partial_.substr(0, end);
    if (line.starts_with(kItself)) line.erase(0, kItself.size());  // we say that ourselves
    if (!parse_progress(line, &progress_)) last_line_ = line;
  }
}

bool ChildBake::poll() {
  if (!running()) return false;
  char bytes[4096];
  for (;;) {
    const ssize_t n = ::read(from_, bytes, sizeof bytes);
    if (n > 0) {
      take(bytes, static_cast<size_t>(n));
      continue;
    }
    if (n < 0 && errno == EINTR) continue;
    if (n < 0 && errno == EAGAIN) return false;
    break;  // it has closed its end: it is ending
  }
  int status = 0;
  while (::waitpid(child_, &status, 0) < 0 && errno == EINTR) {
  }
  ::close(from_);
  child_ = from_ = -1;
  if (WIFEXITED(status) && WEXITSTATUS(status) == 0) {
    result_ = absl::OkStatus();
  } else if (cancelled_) {
    result_ = absl::CancelledError("the bake was cancelled");
  } else {
    result_ = absl::AbortedError(last_line_.empty() ? "the bake ended without a word" : last_line_);
  }
  return true;
}

void ChildBake::cancel() {
  if (!running()) return;
  cancelled_ = true;
  ::kill(child_, SIGTERM);
}

}  // namespace lightloom::view
