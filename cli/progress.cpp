#include "cli/progress.h"

#include <unistd.h>

#include <cmath>
#include <cstdio>

#include "cli/interrupt.h"

namespace lightloom {
namespace {

std::string format(const char* pattern, double value, const char* suffix) {
  char text[64];
  std::snprintf(text, sizeof text, pattern, value, suffix);
  return text;
}

std::string scaled(double value, double base, const char* const* suffixes, int count) {
  int i = 0;
  while (i + 1 < count && std::abs(value) >= base) value /= base, ++i;
  return format(i == 0 || value >= 100 ? "%.0f %s" : value >= 10 ? "%.1f %s" : "%.2f %s", value, suffixes[i]);
}

}  // namespace

std::string human_bytes(double bytes) {
  static const char* const kSuffixes[] = {"B", "KB", "MB", "GB", "TB"};
  return scaled(bytes, 1000, kSuffixes, 5);
}

std::string human_count(double n) {
  static const char* const kSuffixes[] = {"", "k", "M", "G", "T"};
  return scaled(n, 1000, kSuffixes, 5);
}

std::string human_seconds(double s) {
  char text[64];
  const int whole = static_cast<int>(s);
  if (s < 60)
    std::snprintf(text, sizeof text, "%.1fs", s);
  else if (s < 3600)
    std::snprintf(text, sizeof text, "%dm%02ds", whole / 60, whole % 60);
  else
    std::snprintf(text, sizeof text, "%dh%02dm", whole / 3600, whole / 60 % 60);
  return text;
}

ProgressBar::ProgressBar() : on_(::isatty(STDERR_FILENO) == 1), started_(Clock::now()), last_(started_) {}

void ProgressBar::update(const std::string& stage, uint64_t done, uint64_t total, uint64_t rays) {
  const auto now = Clock::now();
  if (stage != stage_) {
    finish();
    stage_ = stage;
    started_ = now;
  } else if (done < total && now - last_ < std::chrono::milliseconds(100)) {
    return;
  }
  last_ = now;
  if (!on_ || total == 0) return;
  const double share = static_cast<double>(done) / static_cast<double>(total);
  const double seconds = std::chrono::duration<double>(now - started_).count();
  constexpr int kWidth = 30;
  const int filled = static_cast<int>(share * kWidth);
  std::string bar(static_cast<size_t>(filled), '=');
  bar.resize(kWidth, ' ');
  const std::string eta = share > 0 && done < total ? " ETA " + human_seconds(seconds / share - seconds) : "";
  const std::string rate = rays > 0 && seconds > 0 ? human_count(static_cast<double>(rays) / seconds) + "rays/s" : "";
  std::fprintf(stderr, "\r\033[K%-22s [%s] %3.0f %%  %s%s  %s", stage.c_str(), bar.c_str(), share * 100,
               human_seconds(seconds).c_str(), eta.c_str(), rate.c_str());
  drawn_ = true;
}

void ProgressBar::finish() {
  if (drawn_) std::fputc('\n', stderr);
  drawn_ = false;
}

Parallel ProgressBar::parallel(const std::string& stage, int threads) {
  Parallel how;
  how.threads = threads;
  how.cancel = &interrupted();
  how.progress = [this, stage](uint64_t done, uint64_t total) { update(stage, done, total); };
  return how;
}

}  // namespace lightloom
