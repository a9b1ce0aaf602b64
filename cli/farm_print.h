// How the farm commands show jobs.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "cli/farm_client.h"

namespace lightloom {

nlohmann::json to_json(const RemoteJob& job);
/// A command's result: "job 7: <what>", or the job as JSON.
void print_job(const RemoteJob& job, const std::string& what, bool json);
/// "12 of 650 tasks, 1 failed, 2 running on 2 workers, 2.31 Mrays/s".
std::string progress_line(const RemoteJob& job);
/// "anna-1  2 of 8 threads busy, heard 1 s ago"; gone: one that was silent for more than a minute.
std::string worker_line(const RemoteWorker& worker);
/// OK for a job that is done; else an error that says how it ended, and where at `server` to see why.
absl::Status how_it_ended(const RemoteJob& job, const std::string& server);
/// Local time, "2026-11-22 12:34:56".
std::string local_time(int64_t unix_ms);

}  // namespace lightloom
