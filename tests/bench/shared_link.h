// One direction of the coordinator's network link, by a made-up clock.
#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <utility>
#include <vector>

#include "tests/support/agenda.h"

namespace lightloom::bench {

/// Its transfers share the rate evenly, as the streams of one server do.
class SharedLink {
 public:
  SharedLink(test::Agenda<double>* agenda, double bytes_per_second) : agenda_(*agenda), rate_(bytes_per_second) {}

  void send(double bytes, std::function<void()> arrived) {
    advance();
    under_way_.emplace(each_ + bytes, std::move(arrived));
    plan();
  }
  double busy_seconds() const { return busy_seconds_; }

 private:
  void advance() {
    const double seconds = agenda_.now() - at_;
    at_ = agenda_.now();
    if (under_way_.empty()) return;
    each_ += seconds * rate_ / static_cast<double>(under_way_.size());
    busy_seconds_ += seconds;
  }
  /// When the next one arrives, if none comes between.
  void plan() {
    ++plans_;
    if (under_way_.empty()) return;
    const double seconds = (under_way_.begin()->first - each_) * static_cast<double>(under_way_.size()) / rate_;
    agenda_.in(seconds, [this, current = plans_] {
      if (current != plans_) return;
      advance();
      constexpr double kRounding = 1e-3;  // bytes
      std::vector<std::function<void()>> arrived;
      const double end = std::max(each_, under_way_.begin()->first) + kRounding;
      while (!under_way_.empty() && under_way_.begin()->first <= end) {
        arrived.push_back(std::move(under_way_.extract(under_way_.begin()).mapped()));
      }
      plan();
      for (const auto& tell : arrived) tell();
    });
  }

  test::Agenda<double>& agenda_;
  const double rate_;
  double at_ = 0, each_ = 0;  // bytes that one would have that was there from the beginning
  double busy_seconds_ = 0;
  uint64_t plans_ = 0;
  std::multimap<double, std::function<void()>> under_way_;  // by what `each_` will be when it is there
};

}  // namespace lightloom::bench
