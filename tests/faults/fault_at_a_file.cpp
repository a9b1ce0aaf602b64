// Preloaded into a program (LD_PRELOAD), it ends the process at its n-th change of files, or is a disk that is full from
// that change on. Changes: writes to regular files, new files and folders, fsync, ftruncate, rename, link and unlink.
// Environment:
//   FAULT_AT_FILE_CHANGE  n, from 1; 0: never
//   FILE_FAULT            kill; power: as kill, and what was not synced is gone (power_loss.h); or full: ENOSPC, but for
//                         what needs no room (ftruncate and unlink)
//   COUNTED_FILE_CHANGES  a file that gets a line with the number of changes at exit
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/mman.h>
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
#include <optional>

#include "tests/faults/power_loss.h"

namespace {

std::atomic<long> changes{0};

template <class F>
F next(const char* name) {
  return reinterpret_cast<F>(::dlsym(RTLD_NEXT, name));
}

bool is_fault(const char* name) {
  const char* const fault = std::getenv("FILE_FAULT");
  return fault != nullptr && std::strcmp(fault, name) == 0;
}

bool loses_power() {
  static const bool yes = is_fault("power");
  return yes;
}

bool is_file(int fd) {
  struct stat s;
  return fd > 2 && ::fstat(fd, &s) == 0 && S_ISREG(s.st_mode);
}

bool makes_file(const char* path, int flags) { return (flags & O_CREAT) != 0 && ::access(path, F_OK) != 0; }

/// Counts a change. False, with errno: the disk has no room for it.
bool count(bool needs_room) {
  static const long at = std::getenv("FAULT_AT_FILE_CHANGE") ? std::atol(std::getenv("FAULT_AT_FILE_CHANGE")) : 0;
  static const bool full = is_fault("full");
  const long n = ++changes;
  if (at == 0 || n < at) return true;
  if (full && needs_room) errno = ENOSPC;
  if (!full && n == at) {
    if (loses_power()) power_loss::strike();
    ::kill(::getpid(), SIGKILL);
  }
  return !full || !needs_room;
}

/// Makes a change, unless the fault comes first. `note`: tells power_loss what it is about to be.
template <class Note, class Make>
auto change(Note note, Make make, bool needs_room = true) -> decltype(make()) {
  if (!loses_power()) return count(needs_room) ? make() : -1;
  const power_loss::Turn turn;
  if (turn.is_inner()) return make();
  count(needs_room);
  note();
  return make();
}
constexpr auto nothing = [] {};

/// `at`: -1: where the descriptor stands.
template <class Make>
ssize_t write_file(int fd, off64_t at, size_t size, Make make) {
  return is_file(fd) ? change([&] { power_loss::before_write(fd, at, size); }, make) : make();
}

int sync_file(int fd, int (*real)(int)) {
  return change(nothing, [&] {
    if (!loses_power()) return real(fd);
    // What outlives this power loss stands in its book: nobody need wait for a disk.
    power_loss::after_sync(fd);
    return ::fcntl(fd, F_GETFD) < 0 ? -1 : 0;
  });
}

template <class What>
void refuse(const char* call, What what) {
  if (!loses_power()) return;
  const power_loss::Turn turn;
  if (!turn.is_inner()) power_loss::refuse(call, what);
}

void note_map(void* map, int protection, int flags, int fd) {
  if (fd < 0 || map == MAP_FAILED || (protection & PROT_WRITE) == 0 || (flags & MAP_SHARED) == 0 || !loses_power())
    return;
  const power_loss::Turn turn;
  if (!turn.is_inner()) power_loss::after_map(fd);
}

struct Report {
  ~Report() {
    const char* const path = std::getenv("COUNTED_FILE_CHANGES");
    if (path == nullptr) return;
    std::optional<power_loss::Turn> turn;  // what this writes is no change
    if (loses_power()) turn.emplace();
    if (std::FILE* const file = std::fopen(path, "a")) {
      std::fprintf(file, "%ld\n", changes.load());
      std::fclose(file);
    }
  }
} report;

int open_and_note(const char* path, int flags, mode_t mode, int (*real)(const char*, int, ...)) {
  const power_loss::Turn turn;
  if (turn.is_inner() || !power_loss::is_followed(path)) return real(path, flags, mode);
  const bool makes = makes_file(path, flags), empties = (flags & O_TRUNC) != 0 && !makes;
  if (makes) {
    count(true);
    power_loss::before_name_changes(path);
  }
  if (empties) flags &= ~O_TRUNC;
  if ((flags & O_ACCMODE) == O_WRONLY) flags = (flags & ~O_ACCMODE) | O_RDWR;  // what is overwritten is read before
  const int fd = real(path, flags, mode);
  if (fd >= 0 && makes) power_loss::after_create(fd);
  if (fd >= 0 && empties) {
    count(false);
    power_loss::before_truncate(fd, 0);
    if (::ftruncate(fd, 0) != 0) std::abort();
  }
  return fd;
}

}  // namespace

extern "C" {

int open64(const char* path, int flags, ...) {
  static const auto real = next<int (*)(const char*, int, ...)>("open64");
  va_list more;
  va_start(more, flags);
  const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(more, mode_t) : 0;
  va_end(more);
  if (loses_power()) return open_and_note(path, flags, mode, real);
  return makes_file(path, flags) && !count(true) ? -1 : real(path, flags, mode);
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
  const auto make = [&] { return real(path, mode); };
  return ::access(path, F_OK) != 0 ? change([&] { power_loss::before_name_changes(path); }, make) : make();
}
ssize_t write(int fd, const void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  return write_file(fd, -1, size, [&] { return real(fd, data, size); });
}
ssize_t writev(int fd, const struct iovec* parts, int count) {
  static const auto real = next<ssize_t (*)(int, const struct iovec*, int)>("writev");
  size_t size = 0;
  for (int i = 0; i < count; ++i) size += parts[i].iov_len;
  return write_file(fd, -1, size, [&] { return real(fd, parts, count); });
}
ssize_t pwrite64(int fd, const void* data, size_t size, off64_t at) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t, off64_t)>("pwrite64");
  return write_file(fd, at, size, [&] { return real(fd, data, size, at); });
}
ssize_t pwrite(int fd, const void* data, size_t size, off_t at) { return pwrite64(fd, data, size, at); }
int ftruncate64(int fd, off64_t size) noexcept {
  static const auto real = next<int (*)(int, off64_t)>("ftruncate64");
  const auto make = [&] { return real(fd, size); };
  return is_file(fd) ? change([&] { power_loss::before_truncate(fd, size); }, make, false) : make();
}
int ftruncate(int fd, off_t size) noexcept { return ftruncate64(fd, size); }
int fsync(int fd) {
  static const auto real = next<int (*)(int)>("fsync");
  return sync_file(fd, real);
}
int fdatasync(int fd) {
  static const auto real = next<int (*)(int)>("fdatasync");
  return sync_file(fd, real);
}
int rename(const char* from, const char* to) noexcept {
  static const auto real = next<int (*)(const char*, const char*)>("rename");
  return change(
      [&] {
        power_loss::before_name_changes(from);
        power_loss::before_name_changes(to);
      },
      [&] { return real(from, to); });
}
int link(const char* from, const char* to) noexcept {
  static const auto real = next<int (*)(const char*, const char*)>("link");
  return change([&] { power_loss::before_name_changes(to); }, [&] { return real(from, to); });
}
int unlink(const char* path) noexcept {
  static const auto real = next<int (*)(const char*)>("unlink");
  return change([&] { power_loss::before_name_changes(path); }, [&] { return real(path); }, false);
}
int remove(const char* path) noexcept {
  static const auto real = next<int (*)(const char*)>("remove");
  return change([&] { power_loss::before_name_changes(path); }, [&] { return real(path); }, false);
}

// No changes, but a power loss takes what was written so.
void* mmap64(void* at, size_t size, int protection, int flags, int fd, off64_t offset) noexcept {
  static const auto real = next<void* (*)(void*, size_t, int, int, int, off64_t)>("mmap64");
  void* const map = real(at, size, protection, flags, fd, offset);
  note_map(map, protection, flags, fd);
  return map;
}
void* mmap(void* at, size_t size, int protection, int flags, int fd, off_t offset) noexcept {
  return mmap64(at, size, protection, flags, fd, offset);
}

// What the programs under test do not do to the files that a power loss is about; should one begin to, it must be added.
std::FILE* fopen64(const char* path, const char* mode) {
  static const auto real = next<std::FILE* (*)(const char*, const char*)>("fopen64");
  if (std::strpbrk(mode, "wa+") != nullptr) refuse("fopen", path);
  return real(path, mode);
}
std::FILE* fopen(const char* path, const char* mode) { return fopen64(path, mode); }
int rmdir(const char* path) noexcept {
  static const auto real = next<int (*)(const char*)>("rmdir");
  refuse("rmdir", path);
  return real(path);
}
int truncate64(const char* path, off64_t size) noexcept {
  static const auto real = next<int (*)(const char*, off64_t)>("truncate64");
  refuse("truncate", path);
  return real(path, size);
}
int truncate(const char* path, off_t size) noexcept { return truncate64(path, size); }
ssize_t sendfile64(int to, int from, off64_t* at, size_t size) noexcept {
  static const auto real = next<ssize_t (*)(int, int, off64_t*, size_t)>("sendfile64");
  refuse("sendfile", to);
  return real(to, from, at, size);
}
ssize_t sendfile(int to, int from, off_t* at, size_t size) noexcept { return sendfile64(to, from, at, size); }

}  // extern "C"
