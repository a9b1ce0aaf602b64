// What went wrong first in a loop of many threads.
#pragma once

#include <atomic>
#include <mutex>

#include "core/base/status.h"

namespace lightloom {

/// The first error of many threads.
class FirstError {
 public:
  void note(const absl::Status& status) {
    const std::lock_guard lock(mutex_);
    if (status_.ok()) status_ = status;
    failed_ = true;
  }
  /// Further work is not worth it.
  bool failed() const { return failed_.load(std::memory_order_relaxed); }
  /// REQUIRES: the threads have ended.
  const absl::Status& status() const { return status_; }

 private:
  std::mutex mutex_;
  std::atomic<bool> failed_{false};
  absl::Status status_;  // guarded by mutex_
};

}  // namespace lightloom
