// Who gets which task next. Pure: no clock, no network, no store.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace lightloom {

/// A task that waits, or that has been leased.
struct TaskView {
  int64_t task = 0;
  int64_t order = 0;  ///< neighbours have near numbers
};
struct LeasedView {
  int64_t task = 0;
  int64_t order = 0;
  std::vector<std::string> workers;  ///< that have it
  int64_t oldest_ms = 0;             ///< when the first of these leases began
};

/// What a running job has to give out.
struct JobView {
  int64_t job = 0;
  std::string client;
  int32_t priority = 0;
  std::vector<TaskView> ready;     ///< nobody has them; by order, perhaps not all
  std::vector<LeasedView> leased;  ///< all
};

/// A worker that asks.
struct Demand {
  std::string worker;
  uint32_t room = 0;  ///< tasks that it could take
  int64_t last_job = 0;
  int64_t last_order = 0;  ///< of the task that it took last
};

struct DecideOptions {
  /// Orders are taken in runs of so many by one worker: its caches then hold what neighbours need.
  int64_t run = 16;
  /// A task that is out for so long is leased once more when nothing else is left to do.
  int64_t straggler_ms = 60'000;
};

struct Decision {
  int64_t job = 0, task = 0, order = 0;
  std::string worker;
};

/// Gives room away, one task at a time: to the job of highest priority; then the client, then the job with the fewest
/// tasks out; then the oldest job. Within the job: the worker's own run of orders, then one that nobody is in, then the
/// first. Stragglers when there is nothing else. At most two leases a task.
std::vector<Decision> decide(std::vector<JobView> jobs, std::vector<Demand> demands, int64_t now_ms,
                             const DecideOptions& options = {});

}  // namespace lightloom
