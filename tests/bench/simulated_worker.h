// A worker that only waits: what bake-worker/worker.cpp does, with tasks and transfers that take their time by a made-up
// clock.
#pragma once

#include <algorithm>
#include <cstdint>
#include <deque>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "bake-server/coordinator/dispatcher.h"
#include "core/base/rng.h"
#include "tests/bench/shared_link.h"
#include "tests/bench/simulated_coordinator.h"
#include "tests/support/agenda.h"

namespace lightloom::bench {

/// What all workers of a farm share.
struct Surroundings {
  test::Agenda<double>& agenda;
  SharedLink from_server, to_server;
  SimulatedCoordinator coordinator;
  double latency_seconds = 0;  ///< one way
  double level_bytes = 0, result_bytes = 0;
  double plan_seconds = 0;  ///< every worker plans the level before its first task
  double blob_seconds = 0;  ///< until the server has put a result on its disk
  std::function<double(const Assignment&)> seconds_of;
  std::function<std::vector<Digest>(const Assignment&)> outputs_of;
  std::function<std::vector<NewTask>(const Assignment&)> spawned_by;

  // What comes of it:
  std::vector<double> waits = {};  ///< seconds without a task of each gap between two tasks of one thread
  uint64_t deaths_with_tasks = 0;
  double seconds_of_the_dead = 0;   ///< of tasks that they computed before
  double levels_ready_seconds = 0;  ///< when the last one was planned
};

enum class Fate { kHealthy, kFailsEachTask, kDies };

class SimulatedWorker {
 public:
  SimulatedWorker(Surroundings* around, std::string name, Fate fate, uint64_t seed)
      : around_(*around), name_(std::move(name)), fate_(fate), rng_(seed) {}

  /// Its first Sync.
  void begin() { sync(); }
  /// From now on nobody hears of it.
  void die() {
    dead_ = true;
    around_.deaths_with_tasks += running_.empty() ? 0 : 1;
  }

 private:
  struct Running {
    Assignment task;
    double begun = 0;
  };

  // As bake-worker/worker.cpp. One thread: the ideal is by workers.
  static constexpr uint32_t kThreads = 1, kBegun = kThreads + 1 + kThreads / 8;
  static constexpr double kProgressEvery = 1.0, kTogether = 0.1, kRetry = 0.5, kAheadSeconds = 0.25;
  static constexpr uint32_t kIdleWaitMs = 10'000, kProgressMs = 1'000;

  bool has_news() const { return !finished_.empty() || !failed_.empty(); }
  uint32_t room() const {
    const double ahead = mean_seconds_ > 0 ? kThreads * kAheadSeconds / mean_seconds_ : 0;
    const size_t wanted = kThreads + static_cast<size_t>(std::min<double>(ahead, kBegun));
    return wanted > running_.size() ? static_cast<uint32_t>(wanted - running_.size()) : 0;
  }

  double next_sync() const {
    if (has_news()) return queue_.empty() ? 0 : std::min(news_since_ + kTogether, synced_ + kProgressEvery);
    return hungry_ && room() > 0 ? 0 : synced_ + kProgressEvery;
  }

  /// There may be something to say.
  void tell() {
    if (has_news() && news_since_ < 0) news_since_ = around_.agenda.now();
    if (waiting_) {  // that call is given up, and its answer lost
      waiting_ = in_call_ = false;
      ++calls_;
      return sync();
    }
    consider_sync();
  }

  void consider_sync() {
    if (dead_ || in_call_) return;
    const double now = around_.agenda.now(), at = next_sync();
    if (at <= now) return sync();
    if (wakes_at_ > now && wakes_at_ <= at) return;
    wakes_at_ = at;
    around_.agenda.at(at, [this] { consider_sync(); });
  }

  void sync() {
    if (dead_) return;
    SyncMessage m;
    m.worker = name_;
    m.threads = kThreads;
    m.incarnation = 1;
    m.sequence = ++sequence_;
    m.seen = seen_;
    for (const auto& [attempt, running] : running_) m.running.push_back({attempt, 1});
    for (const auto& [attempt, task] : finished_) {
      m.finished.push_back({attempt, around_.outputs_of(task), around_.spawned_by(task), 1});
    }
    for (const auto& [attempt, task] : failed_) m.failed.push_back({attempt, "this worker fails all"});
    m.room = asked_ = room();
    news_since_ = -1;
    if (m.room > 0 && !has_news()) {
      m.wait_ms = running_.empty() ? kIdleWaitMs : kProgressMs;
      waiting_ = true;
    }
    in_call_ = true;
    const auto answered = [this, call = ++calls_](const absl::StatusOr<SyncAnswer>& answer) {
      around_.agenda.in(around_.latency_seconds, [this, call, answer] { hear(call, answer); });
    };
    around_.agenda.in(around_.latency_seconds,
                      [this, m = std::move(m), answered] { around_.coordinator.hear(m, answered); });
  }

  void hear(uint64_t call, const absl::StatusOr<SyncAnswer>& answer) {
    if (dead_ || call != calls_) return;
    waiting_ = in_call_ = false;
    if (!answer.ok()) return around_.agenda.in(kRetry, [this] { consider_sync(); });
    synced_ = around_.agenda.now();
    seen_ = answer->sequence;
    hungry_ = answer->assignments.size() < asked_;
    for (const std::string& attempt : answer->acknowledged) {
      finished_.erase(attempt);
      failed_.erase(attempt);
    }
    for (const std::string& attempt : answer->lost) lose(attempt);
    if (!answer->warm.empty()) need_level();
    for (const Assignment& a : answer->assignments) {
      if (running_.contains(a.attempt) || finished_.contains(a.attempt) || failed_.contains(a.attempt)) continue;
      running_.emplace(a.attempt, Running{a});
      queue_.push_back(a.attempt);
    }
    pump();
    tell();
  }

  /// Fetches the level and plans it, once.
  void need_level() {
    if (std::exchange(level_asked_, true)) return;
    around_.from_server.send(around_.level_bytes, [this] {
      around_.agenda.in(around_.plan_seconds, [this] {
        level_ready_ = true;
        around_.levels_ready_seconds = around_.agenda.now();
        if (!dead_) pump();
      });
    });
  }

  /// Begins what may be begun; who comes back goes before who is new.
  void pump() {
    while (begun_.size() + back_.size() + computing_ + uploading_ < kBegun && !queue_.empty()) {
      begun_.push_back(queue_.front());
      running_.at(queue_.front()).begun = around_.agenda.now();
      queue_.pop_front();
      need_level();
    }
    while (computing_ < kThreads && !back_.empty()) {
      const std::string attempt = back_.front();
      back_.pop_front();
      end_task(attempt, true);
    }
    while (level_ready_ && computing_ < kThreads && !begun_.empty()) {
      const std::string attempt = begun_.front();
      begun_.pop_front();
      compute(attempt);
    }
    if (level_ready_ && computing_ == 0 && idle_since_ < 0) idle_since_ = around_.agenda.now();
  }

  void compute(const std::string& attempt) {
    ++computing_;
    if (fate_ == Fate::kHealthy) around_.waits.push_back(idle_since_ < 0 ? 0 : around_.agenda.now() - idle_since_);
    idle_since_ = -1;
    const double whole = around_.seconds_of(running_.at(attempt).task);
    const double seconds = fate_ == Fate::kFailsEachTask ? whole * static_cast<double>(rng_.next_float()) : whole;
    around_.agenda.in(seconds, [this, attempt, seconds] {
      if (dead_) return;
      --computing_;
      if (!running_.contains(attempt)) {  // lost meanwhile
      } else if (fate_ == Fate::kFailsEachTask) {
        end_task(attempt, false);
      } else {
        if (fate_ == Fate::kDies) around_.seconds_of_the_dead += seconds;
        ++uploading_;
        around_.agenda.in(around_.blob_seconds, [this, attempt] {
          around_.to_server.send(around_.result_bytes, [this, attempt] { come_back(attempt); });
        });
      }
      pump();
    });
  }

  void come_back(const std::string& attempt) {
    if (dead_) return;
    --uploading_;
    if (running_.contains(attempt)) back_.push_back(attempt);
    pump();
  }

  void end_task(const std::string& attempt, bool ok) {
    const auto task = running_.extract(attempt);
    if (task.empty()) return;
    const double seconds = around_.agenda.now() - task.mapped().begun;
    if (ok) mean_seconds_ = mean_seconds_ > 0 ? (mean_seconds_ + seconds) / 2 : seconds;
    (ok ? finished_ : failed_).emplace(attempt, task.mapped().task);
    tell();
  }

  /// What is being computed goes on to its end here, which a real worker would stop: it matters to few.
  void lose(const std::string& attempt) {
    running_.erase(attempt);
    std::erase(queue_, attempt);
    std::erase(begun_, attempt);
    std::erase(back_, attempt);
    hungry_ = true;
  }

  Surroundings& around_;
  const std::string name_;
  const Fate fate_;
  Rng rng_;
  bool dead_ = false;
  uint64_t sequence_ = 0, seen_ = 0, calls_ = 0;
  bool in_call_ = false, waiting_ = false, hungry_ = true;
  double news_since_ = -1, synced_ = 0, wakes_at_ = -1;
  double mean_seconds_ = 0, idle_since_ = -1;
  bool level_asked_ = false, level_ready_ = false;
  std::map<std::string, Running> running_;  // by attempt: begun or not
  std::deque<std::string> queue_;           // not begun
  std::deque<std::string> begun_, back_;    // wait for a thread: new, with their result on the server
  uint32_t computing_ = 0, uploading_ = 0, asked_ = 0;
  std::map<std::string, Assignment> finished_, failed_;
};

}  // namespace lightloom::bench
