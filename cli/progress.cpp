#include "cli/progress.h"

#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
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

std::string Eta::text(uint64_t done, uint64_t total) {
  const auto now = std::chrono::steady_clock::now();
  if (total != total_) {
    total_ = total;
    first_ = done;
    started_ = now;
  }
  if (done <= first_ || done >= total) return "";
  const double seconds = std::chrono::duration<double>(now - started_).count();
  return "ETA " + human_seconds(seconds / static_cast<double>(done - first_) * static_cast<double>(total - done));
}

ProgressBar::ProgressBar() : on_(::isatty(STDERR_FILENO) == 1), started_(Clock::now()), last_(started_) {}

void ProgressBar::update(const std::string& stage, uint64_t done, uint64_t total, uint64_t rays) {
  if (stage != stage_) {
    eta_ = Eta();
    started_ = Clock::now();
    first_rays_ = rays;
  }
  const double seconds = std::chrono::duration<double>(Clock::now() - started_).count();
  const uint64_t shot = rays - std::min(rays, first_rays_);
  std::string words = human_seconds(seconds);
  if (const std::string eta = eta_.text(done, total); !eta.empty()) words += ", " + eta;
  if (shot > 0 && seconds > 0) words += ", " + human_count(static_cast<double>(shot) / seconds) + "rays/s";
  draw(stage, done, total, words);
}

void ProgressBar::draw(const std::string& stage, uint64_t done, uint64_t total, const std::string& words) {
  const auto now = Clock::now();
  if (stage != stage_) {
    finish();
    stage_ = stage;
  } else if (done < total && now - last_ < std::chrono::milliseconds(100)) {
    return;
  }
  last_ = now;
  if (lines_) {
    std::fprintf(stderr, "progress %s %llu %llu\n", stage.c_str(), static_cast<unsigned long long>(done),
                 static_cast<unsigned long long>(total));
    return;
  }
  if (!on_ || total == 0) return;
  const double share = static_cast<double>(done) / static_cast<double>(total);
  constexpr int kWidth = 20;
  std::string bar(static_cast<size_t>(share * kWidth), '=');
  bar.resize(kWidth, ' ');
  char percent[16];
  std::snprintf(percent, sizeof percent, "%3.0f %%", share * 100);
  std::string line = stage;
  line.resize(std::max<size_t>(line.size(), 9), ' ');
  line += " [" + bar + "] " + percent + "  " + words;
  // A line that wraps would not be drawn over.
  winsize window{};
  if (::ioctl(STDERR_FILENO, TIOCGWINSZ, &window) == 0 && window.ws_col > 1) {
    line.resize(std::min<size_t>(line.size(), window.ws_col - 1));
  }
  std::fprintf(stderr, "\r\033[K%s", line.c_str());
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
