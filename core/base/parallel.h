// Data-parallel loops and their progress. The result of a loop must not depend on how its iterations are spread.
#pragma once

#include <atomic>
#include <cstdint>
#include <functional>

namespace lightloom {

/// Set from any thread (a signal handler too); long operations look at it and stop early.
class CancelFlag {
 public:
  void cancel() { cancelled_.store(true, std::memory_order_relaxed); }
  bool cancelled() const { return cancelled_.load(std::memory_order_relaxed); }

 private:
  std::atomic<bool> cancelled_{false};
};

/// Of a setting where 0 means one per hardware thread.
int thread_count(int threads);

/// How a loop runs. threads = 0 means one per hardware thread; fewer run if the system has no more.
struct Parallel {
  int threads = 0;
  const CancelFlag* cancel = nullptr;
  /// Called after each iteration with how many are done, from any worker, one call at a time.
  std::function<void(uint64_t done, uint64_t total)> progress;
};

/// Runs body(i) for i in [0, n), each exactly once, in no particular order. Returns false if cancelled before the
/// end. The first exception that a body throws stops the loop and is rethrown here.
bool parallel_for(uint64_t n, const Parallel& how, const std::function<void(uint64_t)>& body);

}  // namespace lightloom
