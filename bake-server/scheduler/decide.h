// Who gets which task next. Pure: no clock, no network, no store.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "bake-server/store/store.h"

namespace lightloom {

/// A worker that asks.
struct Demand {
  std::string worker;
  uint32_t room = 0;  ///< tasks that it could take
  JobId last_job = 0;
  int64_t last_order = 0;        ///< of the task that it took last
  uint32_t threads = 0;          ///< tasks that it runs at once
  std::vector<JobId> held = {};  ///< jobs of the tasks that it has, running or queued
};

struct DecideOptions {
  /// Orders are taken in runs of so many by one worker: its caches then hold what neighbours need.
  int64_t run = 16;
  /// A task that is out for so long is leased once more when nothing else is left to do.
  int64_t straggler_ms = 60'000;
};

struct Decision {
  JobId job = 0;
  TaskId task = 0;
  int64_t order = 0;
  std::string worker;
};

/// Gives room away, one task at a time: to the job of highest priority; then the client, then the job with the fewest
/// tasks out; then the oldest job. Within the job: the worker's own run of orders, then one that nobody is in, then the
/// first. Stragglers when there is nothing else. At most two leases a task. A worker without room, which has tasks queued
/// behind those it runs, gets one of higher priority all the same while it has fewer such than threads: it starts it
/// with the next thread that is free.
/// Who failed a task gets it no more while there is a worker that did not. `others`: workers that are there, but do not
/// ask now. `suspects`: workers that failed all they had of late. What has failed before goes to one of the rest, if any of
/// them has not failed it: a few broken workers must not fail a task for good between them.
std::vector<Decision> decide(std::vector<JobView> jobs, std::vector<Demand> demands, int64_t now_ms,
                             const DecideOptions& options = {}, const std::vector<std::string>& others = {},
                             const std::set<std::string>& suspects = {});

}  // namespace lightloom
