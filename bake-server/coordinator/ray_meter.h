// Rays shot for each job since the process started, and per second now: for people.
#pragma once

#include <cstdint>
#include <map>

#include "bake-server/store/store.h"

namespace lightloom {

class RayMeter {
 public:
  /// By tasks that are done.
  void add(JobId job, uint64_t rays) { jobs_[job].finished += rays; }
  /// `running`: rays so far of the tasks that run now, by job. Call it often; it measures once a second.
  void measure(const std::map<JobId, uint64_t>& running, int64_t now_ms);

  uint64_t total(JobId job) const;
  double per_second(JobId job) const;

 private:
  struct Job {
    uint64_t finished = 0, running = 0;
    uint64_t last_total = 0;
    int64_t last_ms = 0;
    double per_second = 0;
  };
  std::map<JobId, Job> jobs_;
};

}  // namespace lightloom
