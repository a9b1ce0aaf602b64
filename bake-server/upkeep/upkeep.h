// What a server does now and then so that its state folder does not grow for ever.
#pragma once

#include <condition_variable>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <mutex>
#include <thread>

#include "bake-server/store/store.h"
#include "bake-server/upkeep/collect_garbage.h"
#include "core/base/parallel.h"
#include "core/base/status.h"

namespace lightloom {

struct UpkeepOptions {
  int64_t retain_seconds = 30 * 86'400;  ///< that ended jobs are kept; 0: for ever
  int64_t grace_seconds = 3600;          ///< of collect_garbage()
  int64_t every_ms = 600'000;
  uint32_t rows = 500;  ///< that are deleted at a time: others wait for the store meanwhile
};

/// Forgets old jobs and collects what they leave, in a thread of its own. Thread-safe. The store must outlive it.
class Upkeep {
 public:
  /// Milliseconds, the clock that the store's times are by.
  using Clock = std::function<int64_t()>;

  /// Begins one `every_ms` from now. `state` is the folder that holds blobs/.
  Upkeep(std::filesystem::path state, Store* store, Clock clock, UpkeepOptions options);
  /// Stops at once, also in the middle.
  ~Upkeep();
  Upkeep(const Upkeep&) = delete;
  Upkeep& operator=(const Upkeep&) = delete;

  /// Does it now. Returns what was forgotten: jobs. Unavailable: a gc or a backup of another process is at work; what was
  /// forgotten stays so. Cancelled.
  absl::StatusOr<uint64_t> run();

 private:
  absl::StatusOr<uint64_t> forget();
  void loop();
  bool stopped_within(int64_t ms);

  const std::filesystem::path state_;
  Store* const store_;
  const Clock clock_;
  const UpkeepOptions options_;
  CancelFlag cancel_;
  std::mutex mutex_;
  std::condition_variable stop_;
  std::thread thread_;  // last: it uses the others
};

}  // namespace lightloom
