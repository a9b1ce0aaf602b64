// One server per state folder.
#pragma once

#include <filesystem>

#include "core/base/status.h"

namespace lightloom {

/// FOLDER/lock, held until the end of this object's life, or of the process, however it ends.
class FolderLock {
 public:
  FolderLock() = default;
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

  /// Makes the folder and those above it. FailedPrecondition if another holds the lock. REQUIRES: called once.
  absl::Status take(const std::filesystem::path& folder);

 private:
  int fd_ = -1;
};

}  // namespace lightloom
