// A farm of any size in one thread: the real Dispatcher, scheduler and store; workers, network and clock are made up.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <vector>

#include "tests/bench/simulated_coordinator.h"

namespace lightloom::bench {

struct FarmOptions {
  int workers = 500, tasks = 200'000;
  std::vector<double> task_seconds;      ///< what tasks take: each draws one
  std::optional<double> charge_seconds;  ///< coordinator time of a Sync; none: measured
  /// Of the coordinator, each direction, shared by all: 10 Gbit/s. (Sending a level costs the server 1.7 CPU seconds a
  /// GB: so much keeps two cores busy.)
  double link_bytes_per_second = 1.25e9;
  uint64_t seed = 1;

  double latency_seconds = 0.5e-3;  ///< one way
  double level_bytes = 12.6e6;      ///< Sponza's .glb
  double plan_seconds = 9;          ///< until a worker that has Sponza may begin its first task
  double result_bytes = 77e3;       ///< a cell's blobs, as docs/farm.md counts them
  double blob_seconds = 1.5e-3;     ///< the server's for one task's blobs, beside its coordinator
  double commit_seconds = 0.6e-3;   ///< the disk's for one commit: 1,750 a second; only where time is measured
  double failing = 0.01;            ///< of the workers; at least one of each kind
};

struct FarmReport {
  double seconds = 0;  ///< from the job's submission to its end
  double work_seconds = 0, longest_seconds = 0, ideal_seconds = 0;
  int failing = 0, dying = 0;
  CoordinatorCosts coordinator;
  double levels_ready_seconds = 0, from_server_busy_seconds = 0, to_server_busy_seconds = 0;
  double all_leased_seconds = 0;  ///< when the last cell was first leased: what comes after is the tail
  double wait_mean_seconds = 0, wait_p99_seconds = 0;  ///< of a thread between two tasks
  uint64_t done = 0, failed = 0, on_record_twice = 0;  ///< tasks
  uint64_t leases = 0, expired = 0, failed_attempts = 0, deaths_with_tasks = 0;
  double share() const { return ideal_seconds / seconds; }
  /// Of the ideal for what the healthy ones had to do: in a small farm those that die have done much before.
  double strict_share = 0;
};

/// One job: 'plan' asks for the cells and 'assemble'. Its state goes into `folder`.
FarmReport simulate(const FarmOptions& options, const std::filesystem::path& folder);

/// The second column of a table whose first lines may begin with '#'.
std::vector<double> read_task_seconds(const std::filesystem::path& csv);

}  // namespace lightloom::bench
