// Threads that wait between the passes of a frame, so that running one allocates nothing and starts no thread.
#pragma once

#include <absl/functional/function_ref.h>

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <mutex>
#include <thread>
#include <vector>

namespace lightloom::simd {

class WorkerPool {
 public:
  /// The calling thread is one of `threads`; 0: one per hardware thread. Fewer if the system has no more.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;

  /// Calls task(i) for i in [0, tasks), each once, in no particular order. REQUIRES: task does not throw; no other call
  /// is running.
  void run(uint32_t tasks, absl::FunctionRef<void(uint32_t)> task);

 private:
  void wait_and_work();
  void work();

  std::mutex mutex_;
  std::condition_variable wake_, finished_;
  uint64_t round_ = 0;  // guarded by mutex_, as the next two
  size_t running_ = 0;  ///< workers that have not finished this round
  bool ending_ = false;
  // Written while no worker runs.
  const absl::FunctionRef<void(uint32_t)>* task_ = nullptr;
  uint32_t tasks_ = 0;
  std::atomic<uint32_t> next_{0};
  std::vector<std::thread> workers_;
};

}  // namespace lightloom::simd
