// Changes files as its arguments say, so that a test sees what a fault leaves of them: `write NAME TEXT` (from the
// beginning), `sync NAME`, `rename FROM TO`, `unlink NAME`, `mkdir NAME`, in the folder where it runs.
#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <string>

namespace {

bool write_text(const char* name, const char* text) {
  const int fd = ::open(name, O_WRONLY | O_CREAT | O_CLOEXEC, 0644);
  const auto size = static_cast<ssize_t>(std::strlen(text));
  const bool done = fd >= 0 && ::write(fd, text, std::strlen(text)) == size;
  return ::close(fd) == 0 && done;
}

bool sync_name(const char* name) {
  const int fd = ::open(name, O_RDONLY | O_CLOEXEC);
  const bool done = fd >= 0 && ::fsync(fd) == 0;
  return ::close(fd) == 0 && done;
}

}  // namespace

int main(int, char** argv) {
  for (char** word = argv + 1; *word != nullptr;) {
    const std::string step = *word++;
    const bool two = step == "write" || step == "rename";
    const char* const name = *word != nullptr ? *word++ : "";
    const char* const more = two && *word != nullptr ? *word++ : "";
    const bool done = step == "write"    ? write_text(name, more)
                      : step == "sync"   ? sync_name(name)
                      : step == "rename" ? ::rename(name, more) == 0
                      : step == "unlink" ? ::unlink(name) == 0
                      : step == "mkdir"  ? ::mkdir(name, 0755) == 0
                                         : false;
    if (!done) {
      std::perror((step + " " + name).c_str());
      return 1;
    }
  }
  return 0;
}
