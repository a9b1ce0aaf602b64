#include "core/base/file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <cstring>
#include <string>
#include <system_error>

namespace lightloom {
namespace {

namespace fs = std::filesystem;

/// How to mend a system error; empty if nobody knows.
std::string_view mend(int error) {
  switch (error) {
    case ENOENT:
    case ENOTDIR:
    case ENAMETOOLONG:
    case ELOOP:
      return "; check the path";
    case EACCES:
    case EPERM:
      return "; change its permissions, or choose another place";
    case EROFS:
      return "; choose another place";
    case ENOSPC:
    case EDQUOT:
      return "; free space there, or choose another place";
    default:
      return "";
  }
}

absl::Status system_error(std::string_view what, const fs::path& path, int error = errno) {
  const std::string message =
      std::string(what) + " " + path.string() + ": " + std::strerror(error) + std::string(mend(error));
  if (error == ENOENT) return absl::NotFoundError(message);
  if (error == EACCES || error == EROFS) return absl::PermissionDeniedError(message);
  if (error == ENOSPC || error == EDQUOT) return absl::ResourceExhaustedError(message);
  return absl::UnavailableError(message);
}

/// A file descriptor that closes itself.
class Fd {
 public:
  explicit Fd(int fd) : fd_(fd) {}
  ~Fd() {
    if (fd_ >= 0) ::close(fd_);
  }
  Fd(const Fd&) = delete;
  Fd& operator=(const Fd&) = delete;
  int get() const { return fd_; }

 private:
  int fd_;
};

absl::Status sync_path(const fs::path& path, int flags) {
  const Fd fd(::open(path.c_str(), flags | O_CLOEXEC));
  if (fd.get() < 0) return system_error("cannot open", path);
  if (::fsync(fd.get()) != 0) return system_error("cannot sync", path);
  return absl::OkStatus();
}

absl::Status write_all(const fs::path& path, std::span<const uint8_t> data) {
  const Fd fd(::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
  if (fd.get() < 0) return system_error("cannot create", path);
  while (!data.empty()) {
    const ssize_t n = ::write(fd.get(), data.data(), data.size());
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error("cannot write", path);
    data = data.subspan(static_cast<size_t>(n));
  }
  return absl::OkStatus();
}

}  // namespace

absl::StatusOr<std::vector<uint8_t>> read_file(const fs::path& path) {
  // O_NONBLOCK: opening a pipe would wait for its other end.
  const Fd fd(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (fd.get() < 0) return system_error("cannot open", path);
  struct stat info {};
  if (::fstat(fd.get(), &info) != 0) return system_error("cannot stat", path);
  if (!S_ISREG(info.st_mode)) return absl::InvalidArgumentError(path.string() + " is not a regular file; give one");
  std::vector<uint8_t> data(static_cast<size_t>(info.st_size));
  size_t done = 0;
  while (done < data.size()) {
    const ssize_t n = ::read(fd.get(), data.data() + done, data.size() - done);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return system_error("cannot read", path);
    if (n == 0) return absl::DataLossError(path.string() + " shrank while it was read");
    done += static_cast<size_t>(n);
  }
  return data;
}

absl::Status check_replaceable(const fs::path& path) {
  struct stat info {};
  if (::lstat(path.c_str(), &info) != 0) {
    return errno == ENOENT ? absl::OkStatus() : system_error("cannot write", path);
  }
  if (S_ISREG(info.st_mode)) return absl::OkStatus();
  const char* what = S_ISDIR(info.st_mode)   ? "a folder"
                     : S_ISLNK(info.st_mode) ? "a symbolic link"
                                             : "a device, pipe or socket";
  return absl::FailedPreconditionError("cannot write " + path.string() + ": it is " + what +
                                       "; choose another name, or remove it first");
}

absl::Status check_writable(const fs::path& path) {
  LL_RETURN_IF_ERROR(check_replaceable(path));
  std::error_code error;
  fs::path folder = fs::absolute(path, error).parent_path();
  if (error) return system_error("cannot write", path, error.value());
  // Missing folders are made when something is written: what counts is the one that they will be made in.
  while (!fs::exists(folder, error) && !error && folder.has_relative_path()) folder = folder.parent_path();
  if (error) return system_error("cannot write", path, error.value());
  if (!fs::is_directory(folder, error)) {
    return absl::FailedPreconditionError("cannot write " + path.string() + ": " + folder.string() +
                                         " is not a folder; choose another place");
  }
  const fs::path probe = temporary_beside(folder / "probe");
  const Fd fd(::open(probe.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644));
  if (fd.get() < 0) return system_error("cannot write in", folder);
  ::unlink(probe.c_str());
  return absl::OkStatus();
}

absl::Status make_durable_folder(const fs::path& folder) {
  std::error_code error;
  fs::path path = fs::absolute(folder, error).lexically_normal();
  if (error) return system_error("cannot make folder", folder, error.value());
  if (!path.has_filename()) path = path.parent_path();
  // A folder is as durable as its name, which is in the one above.
  std::vector<fs::path> named_in{path.parent_path()};
  while (!fs::exists(named_in.back(), error) && named_in.back().has_relative_path()) {
    named_in.push_back(named_in.back().parent_path());
  }
  fs::create_directories(path, error);
  if (error) return system_error("cannot make folder", path, error.value());
  for (const fs::path& above : named_in) {
    // One that may not be read, or is of a kind that cannot be synced, has held what we use before.
    const Fd fd(::open(above.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
    if (fd.get() < 0 || ::fsync(fd.get()) == 0) continue;
    if (errno != EINVAL && errno != EROFS && errno != ENOTSUP) return system_error("cannot sync", above);
  }
  return absl::OkStatus();
}

fs::path temporary_beside(const fs::path& path) {
  static std::atomic<uint64_t> counter{0};
  fs::path temporary = path;
  temporary += ".tmp-" + std::to_string(::getpid()) + "-" + std::to_string(counter.fetch_add(1));
  return temporary;
}

absl::Status commit_file(const fs::path& temporary, const fs::path& path) {
  absl::Status status = check_replaceable(path);
  if (status.ok()) status = sync_path(temporary, O_RDONLY);
  if (status.ok() && ::rename(temporary.c_str(), path.c_str()) != 0) status = system_error("cannot write", path);
  if (!status.ok()) {
    ::unlink(temporary.c_str());
    return status;
  }
  const fs::path folder = path.has_parent_path() ? path.parent_path() : fs::path(".");
  return sync_path(folder, O_RDONLY | O_DIRECTORY);
}

absl::Status write_file_atomic(const fs::path& path, std::span<const uint8_t> data) {
  if (std::error_code error; path.has_parent_path() && !fs::is_directory(path.parent_path(), error)) {
    LL_RETURN_IF_ERROR(make_durable_folder(path.parent_path()));
  }
  LL_RETURN_IF_ERROR(check_replaceable(path));
  const fs::path temporary = temporary_beside(path);
  if (absl::Status status = write_all(temporary, data); !status.ok()) {
    ::unlink(temporary.c_str());
    return status;
  }
  return commit_file(temporary, path);
}

absl::Status write_file_atomic(const fs::path& path, std::string_view text) {
  return write_file_atomic(path, {reinterpret_cast<const uint8_t*>(text.data()), text.size()});
}

}  // namespace lightloom
