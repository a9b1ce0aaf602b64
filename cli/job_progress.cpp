#include "cli/job_progress.h"

#include <cstdio>
#include <nlohmann/json.hpp>

#include "cli/farm_print.h"
#include "cli/print_json.h"

namespace lightloom {

void JobProgress::show(const RemoteJob& job) {
  const std::string line = progress_line(job), eta = eta_.text(job.done, job.tasks);
  if (output_ != Output::kJson) {
    // What matters most first: a narrow terminal cuts the rest.
    bar_.draw("job " + std::to_string(job.id), job.done, job.tasks, eta.empty() ? line : eta + ", " + line);
  }
  if (output_ == Output::kBar || (output_ == Output::kText && bar_.on())) return;

  if (job.revision == revision_ && job.rays == rays_) return;
  if (output_ == Output::kText) {
    // The command itself says how it ended.
    const auto now = std::chrono::steady_clock::now();
    if (job.ended() || now - printed_ < std::chrono::seconds(1)) return;
    printed_ = now;
    std::printf("%s%s%s\n", line.c_str(), eta.empty() ? "" : ", ", eta.c_str());
  } else {
    print_json(to_json(job));
  }
  revision_ = job.revision;
  rays_ = job.rays;
  std::fflush(stdout);
}

}  // namespace lightloom
