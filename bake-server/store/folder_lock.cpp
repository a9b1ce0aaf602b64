#include "bake-server/store/folder_lock.h"

#include <absl/strings/str_cat.h>
#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <string>

#include "core/base/file.h"

namespace lightloom {

namespace fs = std::filesystem;

namespace {

absl::Status unusable(const fs::path& folder, int error) {
  const std::string message = absl::StrCat("cannot use the state folder ", folder.string(), ": ", std::strerror(error),
                                           "; change its permissions, or give another");
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(message);
  return absl::PermissionDeniedError(message);
}

}  // namespace

FolderLock::~FolderLock() {
  if (fd_ >= 0) ::close(fd_);
}

absl::Status FolderLock::take(const fs::path& folder) {
  if (const absl::Status made = make_durable_folder(folder); !made.ok()) {
    const bool full = absl::IsResourceExhausted(made);
    return absl::Status(
        full ? made.code() : absl::StatusCode::kPermissionDenied,
        absl::StrCat("cannot use the state folder ", folder.string(), ": ", std::string(made.message())));
  }
  const fs::path file = folder / "lock";
  fd_ = ::open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0644);
  if (fd_ < 0) return unusable(folder, errno);
  if (::flock(fd_, LOCK_EX | LOCK_NB) == 0) return absl::OkStatus();
  if (errno != EWOULDBLOCK) return unusable(folder, errno);
  return absl::FailedPreconditionError(absl::StrCat("another server uses the state folder ", folder.string(),
                                                    " (it holds ", file.string(),
                                                    "): stop it, or give this one another folder"));
}

}  // namespace lightloom
