// How far a farm's job is, while it runs.
#pragma once

#include <chrono>
#include <string>

#include "cli/farm_client.h"
#include "cli/progress.h"

namespace lightloom {

class JobProgress {
 public:
  enum class Output {
    kText,  ///< a bar where stderr is a terminal; else lines on stdout, for changes only and one a second at most
    kBar,   ///< a bar, or nothing
    kJson,  ///< each change as a line on stdout
  };
  explicit JobProgress(Output output) : output_(output) {}

  /// `job` as it is now. To be called several times a second, changed or not, so that what was held back comes out.
  void show(const RemoteJob& job);
  void finish() { bar_.finish(); }

 private:
  const Output output_;
  ProgressBar bar_;
  Eta eta_;
  uint64_t revision_ = 0, rays_ = 0;  // that were printed
  std::chrono::steady_clock::time_point printed_{};
};

}  // namespace lightloom
