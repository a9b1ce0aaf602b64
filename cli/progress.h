// A progress bar with rate and ETA on a terminal; elsewhere silent, or lines for a program that asked for them.
#pragma once

#include <chrono>
#include <cstdint>
#include <string>

#include "core/base/parallel.h"

namespace lightloom {

/// When something will be done, from how fast it went since this was first asked: what was done before says nothing.
class Eta {
 public:
  /// "ETA 2m10s"; empty at the beginning and at the end. Another `total` begins anew.
  std::string text(uint64_t done, uint64_t total);

 private:
  uint64_t first_ = 0, total_ = 0;
  std::chrono::steady_clock::time_point started_;
};

class ProgressBar {
 public:
  ProgressBar();
  ~ProgressBar() { finish(); }

  /// From now on "progress STAGE DONE TOTAL" lines on stderr in place of a bar.
  void print_lines() { lines_ = true; }
  /// Whether there is a terminal to draw on.
  bool on() const { return on_; }
  /// Shows `done` of `total` of `stage`, its time, and the rate of `rays` since it began. Redraws ten times a second at
  /// most.
  void update(const std::string& stage, uint64_t done, uint64_t total, uint64_t rays = 0);
  /// The same with other words behind the bar.
  void draw(const std::string& stage, uint64_t done, uint64_t total, const std::string& words);
  void finish();
  /// A loop's options that report here.
  Parallel parallel(const std::string& stage, int threads);

 private:
  using Clock = std::chrono::steady_clock;
  bool on_;
  bool lines_ = false;
  bool drawn_ = false;
  std::string stage_;
  Eta eta_;
  uint64_t first_rays_ = 0;
  Clock::time_point started_, last_;
};

/// "3.2 MB", "1.5 M", "2m10s".
std::string human_bytes(double bytes);
std::string human_count(double n);
std::string human_seconds(double seconds);

}  // namespace lightloom
