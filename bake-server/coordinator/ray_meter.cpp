#include "bake-server/coordinator/ray_meter.h"

#include <algorithm>

namespace lightloom {
namespace {

constexpr int64_t kEveryMs = 1000;
constexpr double kSmoothing = 0.3;  // share of the newest rate

}  // namespace

void RayMeter::measure(const std::map<JobId, uint64_t>& running, int64_t now_ms) {
  for (auto& [id, job] : jobs_) job.running = 0;
  for (const auto& [id, rays] : running) jobs_[id].running = rays;
  for (auto& [id, job] : jobs_) {
    const int64_t elapsed_ms = now_ms - job.last_ms;
    if (elapsed_ms < kEveryMs) continue;
    // A task that is handed back takes its rays with it: no negative rates.
    const uint64_t total = std::max(job.finished + job.running, job.last_total);
    const double rate =
        job.last_ms > 0 ? 1e3 * static_cast<double>(total - job.last_total) / static_cast<double>(elapsed_ms) : 0;
    job.per_second += kSmoothing * (rate - job.per_second);
    job.last_total = total;
    job.last_ms = now_ms;
  }
}

uint64_t RayMeter::total(JobId id) const {
  const auto job = jobs_.find(id);
  return job == jobs_.end() ? 0 : job->second.finished + job->second.running;
}

double RayMeter::per_second(JobId id) const {
  const auto job = jobs_.find(id);
  return job == jobs_.end() ? 0 : job->second.per_second;
}

}  // namespace lightloom
