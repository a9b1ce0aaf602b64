#include "core/base/parallel.h"

#include <algorithm>
#include <exception>
#include <mutex>
#include <system_error>
#include <thread>
#include <vector>

namespace lightloom {

int thread_count(int threads) {
  return threads > 0 ? threads : std::max(1, static_cast<int>(std::thread::hardware_concurrency()));
}

bool parallel_for(uint64_t n, const Parallel& how, const std::function<void(uint64_t)>& body) {
  const uint64_t count = std::min(static_cast<uint64_t>(thread_count(how.threads)), std::max<uint64_t>(n, 1));

  std::atomic<uint64_t> next{0};
  std::atomic<bool> stop{false};
  std::mutex mutex;  // guards done, error and the progress callback
  uint64_t done = 0;
  std::exception_ptr error;

  const auto work = [&] {
    while (!stop.load(std::memory_order_relaxed) && !(how.cancel && how.cancel->cancelled())) {
      const uint64_t i = next.fetch_add(1);
      if (i >= n) return;
      try {
        body(i);
      } catch (...) {
        const std::lock_guard lock(mutex);
        if (!error) error = std::current_exception();
        stop.store(true);
        return;
      }
      const std::lock_guard lock(mutex);
      ++done;
      if (how.progress) how.progress(done, n);
    }
  };

  std::vector<std::jthread> threads;
  threads.reserve(count - 1);
  try {
    for (uint64_t t = 1; t < count; ++t) threads.emplace_back(work);
  } catch (const std::system_error&) {  // the system has no more: those that there are do the work
  }
  work();
  threads.clear();  // joins

  if (error) std::rethrow_exception(error);
  return done == n;
}

}  // namespace lightloom
