// A progress bar with rate and ETA on a terminal; silent elsewhere.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "core/base/parallel.h"

namespace lightloom {

class ProgressBar {
 public:
  ProgressBar();
  ~ProgressBar() { finish(); }

  /// Shows `done` of `total` of `stage`, and the rate of `rays` since it began. Redraws ten times a second at most.
  void update(const std::string& stage, uint64_t done, uint64_t total, uint64_t rays = 0);
  void finish();
  /// A loop's options that report here.
  Parallel parallel(const std::string& stage, int threads);

 private:
  using Clock = std::chrono::steady_clock;
  bool on_;
  bool drawn_ = false;
  std::string stage_;
  Clock::time_point started_, last_;
};

/// "3.2 MB", "1.5 M", "2m10s".
std::string human_bytes(double bytes);
std::string human_count(double n);
std::string human_seconds(double seconds);

}  // namespace lightloom
