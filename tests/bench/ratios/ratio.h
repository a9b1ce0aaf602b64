// What a hot path costs, in units of what bounds it. A machine that is slow or busy for a while is so for both, so that
// ratios of one run can be compared from day to day.
#pragma once

#include <benchmark/benchmark.h>

#include "tests/bench/cpu_time.h"

namespace lightloom::bench {

/// The ratio of one repetition of a Google benchmark: the CPU time of a path ÷ that of its bound. They take turns.
class Ratio {
 public:
  /// `bound` says in words what the path is compared with.
  Ratio(benchmark::State* state, const char* bound) : state_(*state) { state_.SetLabel(bound); }
  ~Ratio() { state_.counters["ratio"] = path_ms_ / bound_ms_; }
  Ratio(const Ratio&) = delete;
  Ratio& operator=(const Ratio&) = delete;

  /// One turn of each, in an order that changes from turn to turn. Both do the same work, on one thread.
  template <class Bound, class Path>
  void turn(const Bound& bound, const Path& path) {
    double path_ms = 0;
    if (path_first_) path_ms = milliseconds_of(path);
    const double bound_ms = milliseconds_of(bound);
    if (!path_first_) path_ms = milliseconds_of(path);
    path_first_ = !path_first_;
    add(path_ms, bound_ms);
  }
  /// A turn that was measured elsewhere.
  void add(double path_ms, double bound_ms) {
    path_ms_ += path_ms;
    bound_ms_ += bound_ms;
    state_.SetIterationTime(1e-3 * path_ms);
  }

 private:
  template <class F>
  static double milliseconds_of(const F& f) {
    const double start = cpu_milliseconds();
    f();
    return cpu_milliseconds() - start;
  }

  benchmark::State& state_;
  double path_ms_ = 0, bound_ms_ = 0;
  bool path_first_ = false;
};

}  // namespace lightloom::bench
