#include "runtime/simd/worker_pool.h"

#include <algorithm>
#include <system_error>

namespace lightloom::simd {

WorkerPool::WorkerPool(int threads) {
  const unsigned count =
      threads > 0 ? static_cast<unsigned>(threads) : std::max(1u, std::thread::hardware_concurrency());
  workers_.reserve(count - 1);
  try {
    for (unsigned i = 1; i < count; ++i) workers_.emplace_back([this] { wait_and_work(); });
  } catch (const std::system_error&) {  // as parallel_for: those that there are do the work
  }
}

void WorkerPool::wait_and_work() {
  std::unique_lock lock(mutex_);
  for (uint64_t seen = 0;;) {
    wake_.wait(lock, [&] { return ending_ || round_ != seen; });
    if (ending_) return;
    seen = round_;
    lock.unlock();
    work();
    lock.lock();
    if (--running_ == 0) finished_.notify_one();
  }
}

WorkerPool::~WorkerPool() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
  }
  wake_.notify_all();
  for (std::thread& t : workers_) t.join();
}

void WorkerPool::run(uint32_t tasks, absl::FunctionRef<void(uint32_t)> task) {
  // Waking a thread costs more than a task alone is worth.
  if (tasks <= 1 || workers_.empty()) {
    for (uint32_t i = 0; i < tasks; ++i) task(i);
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    task_ = &task;
    tasks_ = tasks;
    next_.store(0, std::memory_order_relaxed);
    running_ = workers_.size();
    ++round_;
  }
  wake_.notify_all();
  work();
  std::unique_lock lock(mutex_);
  finished_.wait(lock, [&] { return running_ == 0; });
}

void WorkerPool::work() {
  for (;;) {
    const uint32_t i = next_.fetch_add(1, std::memory_order_relaxed);
    if (i >= tasks_) return;
    (*task_)(i);
  }
}

}  // namespace lightloom::simd
