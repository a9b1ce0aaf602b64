#include "bake-server/upkeep/free_space.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>
#include <sys/statvfs.h>

#include <cerrno>
#include <cstring>
#include <string>
#include <utility>

#include "core/base/parse_size.h"

namespace lightloom {

absl::StatusOr<uint64_t> free_bytes(const std::filesystem::path& path) {
  struct statvfs info {};
  if (::statvfs(path.c_str(), &info) != 0) {
    return absl::UnavailableError(absl::StrCat("cannot measure what is free at ", path.string(), ": ",
                                               std::strerror(errno), "; check that disk"));
  }
  return static_cast<uint64_t>(info.f_bavail) * info.f_frsize;
}

FreeSpace::FreeSpace(std::filesystem::path folder, uint64_t least, Measure measure)
    : folder_(std::move(folder)), least_(least), measure_(std::move(measure)) {}

absl::Status FreeSpace::check() {
  const absl::StatusOr<uint64_t> free = measure_(folder_);
  const bool is_short = free.ok() && *free < least_;
  if (short_.exchange(is_short) != is_short) {
    if (is_short) {
      spdlog::warn(absl::StrCat(size_text(*free), " free at ", folder_.string(), ", less than --min-free ",
                                size_text(least_), ": uploads are refused and no tasks given out until there is more"));
    } else {
      spdlog::info(absl::StrCat("there is room at ", folder_.string(), " again: uploads and tasks go on"));
    }
  }
  if (!is_short) return absl::OkStatus();
  return absl::ResourceExhaustedError(absl::StrCat("the server's disk has ", size_text(*free), " left, and keeps ",
                                                   size_text(least_), ": free space at its ", folder_.string(),
                                                   ", then try again"));
}

}  // namespace lightloom
