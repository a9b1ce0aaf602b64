// A clock that is made up, and what happens by it.
#pragma once

#include <algorithm>
#include <cstdint>
#include <functional>
#include <map>
#include <utility>

namespace lightloom::test {

/// Things that happen at their time; at the same time, in the order in which they were planned.
template <class Time>
class Agenda {
 public:
  Time now() const { return now_; }
  void at(Time time, std::function<void()> what) { queue_.emplace(std::pair(time, next_++), std::move(what)); }
  void in(Time later, std::function<void()> what) { at(now_ + later, std::move(what)); }
  /// False: nothing is left to happen.
  bool step() {
    if (queue_.empty()) return false;
    auto first = queue_.extract(queue_.begin());
    now_ = std::max(now_, first.key().first);
    first.mapped()();
    return true;
  }

 private:
  Time now_ = 0;
  uint64_t next_ = 0;
  std::map<std::pair<Time, uint64_t>, std::function<void()>> queue_;
};

}  // namespace lightloom::test
