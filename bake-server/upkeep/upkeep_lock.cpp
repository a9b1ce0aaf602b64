#include "bake-server/upkeep/upkeep_lock.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

namespace lightloom {
namespace {

namespace fs = std::filesystem;

constexpr int64_t kNanoseconds = 1'000'000'000;

absl::Status unusable(const fs::path& file) {
  return absl::PermissionDeniedError(
      absl::StrCat("cannot lock ", file.string(), ": ", std::strerror(errno), "; change its folder's permissions"));
}

}  // namespace

UpkeepLock::~UpkeepLock() {
  if (fd_ >= 0) ::close(fd_);
}

absl::StatusOr<UpkeepLock> UpkeepLock::take(const fs::path& state, int operation) {
  const fs::path file = state / "upkeep.lock";
  UpkeepLock lock(::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644));
  if (lock.fd_ < 0) return unusable(file);
  int taken = 0;
  do taken = ::flock(lock.fd_, operation);
  while (taken != 0 && errno == EINTR);
  if (taken == 0) return lock;
  if (errno != EWOULDBLOCK) return unusable(file);
  return absl::UnavailableError(absl::StrCat("another gc or a backup works on ", state.string(), " (it holds ",
                                             file.string(), "): try again when it is done"));
}

absl::StatusOr<UpkeepLock> UpkeepLock::take(const fs::path& state) { return take(state, LOCK_EX | LOCK_NB); }
absl::StatusOr<UpkeepLock> UpkeepLock::wait(const fs::path& state) { return take(state, LOCK_EX); }

absl::StatusOr<int64_t> UpkeepLock::now_ns() const {
  struct stat info {};
  if (::futimens(fd_, nullptr) != 0 || ::fstat(fd_, &info) != 0) {
    return absl::UnavailableError(absl::StrCat(
        "cannot read the clock of the state folder's file system: ", std::strerror(errno), "; check that disk"));
  }
  return info.st_mtim.tv_sec * kNanoseconds + info.st_mtim.tv_nsec;
}

}  // namespace lightloom
