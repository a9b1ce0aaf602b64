#include "cli/farm_print.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>

#include "cli/print_json.h"
#include "cli/progress.h"

namespace lightloom {

nlohmann::json to_json(const RemoteJob& job) {
  return {{"job", job.id},
          {"name", job.name},
          {"client", job.client},
          {"priority", job.priority},
          {"state", job.state},
          {"created_ms", job.created_ms},
          {"finished_ms", job.finished_ms},
          {"tasks", job.tasks},
          {"tasks_done", job.done},
          {"tasks_running", job.running},
          {"tasks_failed", job.failed},
          {"tasks_reused", job.reused},
          {"rays", job.rays},
          {"rays_per_second", job.rays_per_second},
          {"workers", job.workers},
          {"error", job.error}};
}

void print_job(const RemoteJob& job, const std::string& what, bool json) {
  if (json) {
    print_json(to_json(job));
  } else {
    std::printf("job %llu: %s\n", static_cast<unsigned long long>(job.id), what.c_str());
  }
}

std::string progress_line(const RemoteJob& job) {
  std::string line = std::to_string(job.done) + " of " + std::to_string(job.tasks) + " tasks";
  if (job.reused > 0) line += " (" + std::to_string(job.reused) + " reused)";
  if (job.failed > 0) line += ", " + std::to_string(job.failed) + " failed";
  if (job.ended()) return line;
  if (job.running == 0) return line + ", waiting for a worker";
  line += ", " + std::to_string(job.running) + " running on " + std::to_string(job.workers) +
          (job.workers == 1 ? " worker" : " workers");
  if (job.rays_per_second > 0) line += ", " + human_count(job.rays_per_second) + "rays/s";
  return line;
}

std::string worker_line(const RemoteWorker& worker) {
  constexpr int64_t kGoneMs = 60'000;
  const std::string silence = human_seconds(1e-3 * static_cast<double>(worker.silent_ms));
  std::string name = worker.id;
  name.resize(std::max<size_t>(name.size(), 32), ' ');
  if (worker.silent_ms > kGoneMs) return name + "  gone, heard " + silence + " ago";
  return name + "  " + std::to_string(worker.running) + " of " + std::to_string(worker.threads) +
         " threads busy, heard " + silence + " ago" + (worker.draining ? ", leaving" : "");
}

absl::Status how_it_ended(const RemoteJob& job, const std::string& server) {
  if (job.state == "done") return absl::OkStatus();
  return absl::AbortedError("job " + std::to_string(job.id) + " ended " + job.state +
                            (job.error.empty() ? "" : ": " + job.error) + "; see lightloom events " +
                            std::to_string(job.id) + " --server " + server);
}

std::string local_time(int64_t unix_ms) {
  const std::time_t seconds = unix_ms / 1000;
  std::tm local{};
  ::localtime_r(&seconds, &local);
  char text[32];
  std::strftime(text, sizeof text, "%Y-%m-%d %H:%M:%S", &local);
  return text;
}

}  // namespace lightloom
