#include "bake-server/upkeep/upkeep.h"

#include <absl/strings/str_cat.h>
#include <spdlog/spdlog.h>

#include <algorithm>
#include <chrono>
#include <string>
#include <utility>

namespace lightloom {
namespace {

constexpr int64_t kLookEveryMs = 1000;  // at the clock
constexpr int64_t kPauseMs = 10;        // between deletions, for others

}  // namespace

Upkeep::Upkeep(std::filesystem::path state, Store* store, Clock clock, UpkeepOptions options)
    : state_(std::move(state)), store_(store), clock_(std::move(clock)), options_(options), thread_([this] {
        loop();
      }) {}

Upkeep::~Upkeep() {
  {
    const std::lock_guard lock(mutex_);
    cancel_.cancel();
  }
  stop_.notify_all();
  thread_.join();
}

bool Upkeep::stopped_within(int64_t ms) {
  std::unique_lock lock(mutex_);
  return stop_.wait_for(lock, std::chrono::milliseconds(ms), [&] { return cancel_.cancelled(); });
}

void Upkeep::loop() {
  int64_t next_ms = clock_() + options_.every_ms;
  while (!stopped_within(std::min(kLookEveryMs, options_.every_ms))) {
    if (clock_() < next_ms) continue;
    const absl::Status status = run().status();
    if (!status.ok() && !absl::IsCancelled(status)) spdlog::warn(absl::StrCat("upkeep: ", status.message()));
    next_ms = clock_() + options_.every_ms;
  }
}

absl::StatusOr<uint64_t> Upkeep::run() {
  LL_ASSIGN_OR_RETURN(const uint64_t jobs, forget());
  if (jobs > 0) {
    spdlog::info(
        absl::StrCat("forgot ", jobs == 1 ? "a job" : absl::StrCat(jobs, " jobs"), " that ended long ago (--retain)"));
  }
  LL_ASSIGN_OR_RETURN(const Garbage garbage,
                      collect_garbage(state_, [this](const VisitDigest& visit) { return store_->referenced(visit); },
                                      {.grace_seconds = options_.grace_seconds, .cancel = &cancel_}));
  if (garbage.blobs + garbage.uploads > 0) spdlog::info("gc " + garbage_text(garbage, false));
  return jobs;
}

absl::StatusOr<uint64_t> Upkeep::forget() {
  uint64_t jobs = 0;
  if (options_.retain_seconds == 0) return jobs;
  const int64_t before_ms = clock_() - options_.retain_seconds * 1000;
  for (bool more = true; more;) {
    LL_ASSIGN_OR_RETURN(const Forgotten forgotten, store_->forget_ended(before_ms, options_.rows));
    jobs += forgotten.jobs;
    more = forgotten.more;
    if (more && stopped_within(kPauseMs)) return absl::CancelledError("the upkeep was stopped");
  }
  return jobs;
}

}  // namespace lightloom
