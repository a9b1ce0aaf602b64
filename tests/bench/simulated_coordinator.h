// The real Dispatcher on a made-up clock: one thread, as Coordinator::loop(), whose turns take what they took here.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bake-server/coordinator/dispatcher.h"
#include "tests/bench/cpu_time.h"
#include "tests/bench/or_exit.h"
#include "tests/support/agenda.h"

namespace lightloom::bench {

struct CoordinatorCosts {
  uint64_t syncs = 0, turns = 0;
  double busy_seconds = 0, longest_turn_seconds = 0;
  double hear_seconds = 0;  ///< of busy_seconds: putting on record what workers say
  double view_seconds = 0;  ///< of busy_seconds, from a sample: Store::view()
};

class SimulatedCoordinator {
 public:
  /// `charge_seconds`: what a Sync costs; none: what its turn took of this thread's CPU, and `commit_seconds` for the
  /// disk.
  SimulatedCoordinator(test::Agenda<double>* agenda, Store* store, BlobStore* blobs,
                       std::optional<double> charge_seconds, double commit_seconds)
      : agenda_(*agenda),
        store_(*store),
        charge_seconds_(charge_seconds),
        commit_seconds_(commit_seconds),
        dispatcher_(store, blobs, options()) {}

  /// A message arrives.
  void hear(SyncMessage message, Dispatcher::OnAnswer answer) {
    inbox_.emplace_back(std::move(message), std::move(answer));
    if (!busy_) turn();
  }
  /// What came in meanwhile is made durable together; nobody hears of it before.
  void turn() {
    busy_ = true;
    auto inbox = std::exchange(inbox_, {});
    const uint64_t syncs = inbox.size();
    std::vector<Dispatcher::Answered> answers;
    const auto now_ms = static_cast<int64_t>(1e3 * agenda_.now());
    const double begun_ms = cpu_milliseconds();
    or_exit(store_.group([&] {
      for (auto& [message, to] : inbox) dispatcher_.hear(std::move(message), std::move(to), now_ms);
      costs_.hear_seconds += 1e-3 * (cpu_milliseconds() - begun_ms);
      answers = dispatcher_.step(now_ms);
      return absl::OkStatus();
    }));
    const double measured = 1e-3 * (cpu_milliseconds() - begun_ms) + commit_seconds_;
    const double seconds = charge_seconds_ ? *charge_seconds_ * static_cast<double>(syncs) : measured;
    costs_.syncs += syncs;
    ++costs_.turns;
    costs_.busy_seconds += seconds;
    costs_.longest_turn_seconds = std::max(costs_.longest_turn_seconds, seconds);
    if (!charge_seconds_ && costs_.turns % kSample == 0) sample_view();
    agenda_.in(seconds, [this, answers = std::move(answers)] {
      for (const auto& a : answers) a.to(a.answer);
      busy_ = false;
      if (!inbox_.empty()) return turn();
      agenda_.in(kTick, [this, turn_before = costs_.turns] {
        if (turn_before == costs_.turns) turn();
      });
    });
  }
  bool idle() const { return !busy_; }
  const CoordinatorCosts& costs() const { return costs_; }

 private:
  static constexpr uint64_t kSample = 64;  // turns
  static constexpr double kTick = 0.1;     // seconds: CoordinatorOptions::tick_ms

  /// As the dispatcher asks for it, once more, since that does not say how long it took.
  void sample_view() {
    const double begun_ms = cpu_milliseconds();
    or_exit(store_.view(256).status());
    costs_.view_seconds += kSample * 1e-3 * (cpu_milliseconds() - begun_ms);
  }
  /// Names that are the same in every run.
  DispatchOptions options() {
    DispatchOptions options;
    options.new_token = [this] { return "attempt " + std::to_string(next_token_++); };
    return options;
  }

  test::Agenda<double>& agenda_;
  Store& store_;
  const std::optional<double> charge_seconds_;
  const double commit_seconds_;
  uint64_t next_token_ = 0;
  Dispatcher dispatcher_;
  bool busy_ = false;
  std::vector<std::pair<SyncMessage, Dispatcher::OnAnswer>> inbox_;
  CoordinatorCosts costs_;
};

}  // namespace lightloom::bench
