// Preloaded into a program (LD_PRELOAD), it kills the process at its n-th change of files: writes to regular files, fsync,
// ftruncate, rename, link and unlink. Environment:
//   KILLED_AT_FILE_CHANGE  n, from 1; 0: never
//   COUNTED_FILE_CHANGES   a file that gets a line with the number of changes at exit
#include <dlfcn.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <csignal>
#include <cstdio>
#include <cstdlib>

namespace {

std::atomic<long> changes{0};

template <class F>
F next(const char* name) {
  return reinterpret_cast<F>(::dlsym(RTLD_NEXT, name));
}

bool is_file(int fd) {
  struct stat s;
  return fd > 2 && ::fstat(fd, &s) == 0 && S_ISREG(s.st_mode);
}

void change() {
  static const long at = std::getenv("KILLED_AT_FILE_CHANGE") ? std::atol(std::getenv("KILLED_AT_FILE_CHANGE")) : 0;
  if (++changes == at) ::kill(::getpid(), SIGKILL);
}

struct Report {
  ~Report() {
    const char* const path = std::getenv("COUNTED_FILE_CHANGES");
    if (path == nullptr) return;
    if (std::FILE* const file = std::fopen(path, "a")) {
      std::fprintf(file, "%ld\n", changes.load());
      std::fclose(file);
    }
  }
} report;

}  // namespace

extern "C" {

ssize_t write(int fd, const void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  if (is_file(fd)) change();
  return real(fd, data, size);
}
ssize_t writev(int fd, const struct iovec* parts, int count) {
  static const auto real = next<ssize_t (*)(int, const struct iovec*, int)>("writev");
  if (is_file(fd)) change();
  return real(fd, parts, count);
}
ssize_t pwrite64(int fd, const void* data, size_t size, off64_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
  if (is_file(fd)) change();
  return real(fd, data, size, at);
}
ssize_t pwrite(int fd, const void* data, size_t size, off_t at) { return pwrite64(fd, data, size, at); }
int ftruncate64(int fd, off64_t size) noexcept {
  static const auto real = next<int (*)(int, off64_t)>("ftruncate64");
  if (is_file(fd)) change();
  return real(fd, size);
}
int ftruncate(int fd, off_t size) noexcept { return ftruncate64(fd, size); }
int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  change();
  return real(fd);
}
int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  change();
  return real(fd);
}
int rename(const char* from, const char* to) noexcept {
  static const auto real = next<int (*)(const char*, const char*)>("rename");
  change();
  return real(from, to);
}
int link(const char* from, const char* to) noexcept {
  static const auto real = next<int (*)(const char*, const char*)>("link");
  change();
  return real(from, to);
}
int unlink(const char* path) noexcept {
  static const auto real = next<int (*)(const char*)>("unlink");
  change();
  return real(path);
}

}  // extern "C"
