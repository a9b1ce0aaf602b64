// Preloaded into a program (LD_PRELOAD), it kills the process at its n-th change of files, or is a disk that is full from
// that change on. Changes: writes to regular files, new files and folders, fsync, ftruncate, rename, link and unlink.
// Environment:
//   FAULT_AT_FILE_CHANGE  n, from 1; 0: never
//   FILE_FAULT            kill, or full: ENOSPC, but for what needs no room (ftruncate and unlink)
//   COUNTED_FILE_CHANGES  a file that gets a line with the number of changes at exit
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>

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

bool makes_file(const char* path, int flags) { return (flags & O_CREAT) != 0 && ::access(path, F_OK) != 0; }

/// Counts a change. False, with errno: the disk has no room for it.
bool change() {
  static const long at = std::getenv("FAULT_AT_FILE_CHANGE") ? std::atol(std::getenv("FAULT_AT_FILE_CHANGE")) : 0;
  static const char* const fault = std::getenv("FILE_FAULT");
  static const bool full = fault != nullptr && std::strcmp(fault, "full") == 0;
  const long n = ++changes;
  if (at == 0 || n < at) return true;
  if (full) errno = ENOSPC;
  if (!full && n == at) ::kill(::getpid(), SIGKILL);
  return !full;
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

int open64(const char* path, int flags, ...) {
  static const auto real = next<int (*)(const char*, int, ...)>("open64");
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  return makes_file(path, flags) && !change() ? -1 : real(path, flags, mode);
}
int open(const char* path, int flags, ...) {
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  return open64(path, flags, mode);
}
int mkdir(const char* path, mode_t mode) noexcept {
  static const auto real = next<int (*)(const char*, mode_t)>("mkdir");
  return ::access(path, F_OK) != 0 && !change() ? -1 : real(path, mode);
}
ssize_t write(int fd, const void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  return is_file(fd) && !change() ? -1 : real(fd, data, size);
}
ssize_t writev(int fd, const struct iovec* parts, int count) {
  static const auto real = next<ssize_t (*)(int, const struct iovec*, int)>("writev");
  return is_file(fd) && !change() ? -1 : real(fd, parts, count);
}
ssize_t pwrite64(int fd, const void* data, size_t size, off64_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
  return is_file(fd) && !change() ? -1 : real(fd, data, size, at);
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
  return change() ? real(fd) : -1;
}
int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  return change() ? real(fd) : -1;
}
int rename(const char* from, const char* to) noexcept {
  static const auto real = next<int (*)(const char*, const char*)>("rename");
  return change() ? real(from, to) : -1;
}
int link(const char* from, const char* to) noexcept {
  static const auto real = next<int (*)(const char*, const char*)>("link");
  return change() ? real(from, to) : -1;
}
int unlink(const char* path) noexcept {
  static const auto real = next<int (*)(const char*)>("unlink");
  change();
  return real(path);
}

}  // extern "C"
