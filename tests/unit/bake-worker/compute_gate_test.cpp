#include "bake-worker/compute_gate.h"

#include <gtest/gtest.h>

#include <atomic>
#include <latch>
#include <thread>
#include <vector>

namespace lightloom {
namespace {

TEST(ComputeGate, NeverMoreThanItsSlotsCompute) {
  ComputeGate gate(2);
  std::atomic<int> computing{0}, most{0};
  const auto compute = [&] {
    const int now = ++computing;
    for (int m = most; m < now && !most.compare_exchange_weak(m, now);) {
    }
    std::this_thread::yield();
    --computing;
  };
  {
    std::vector<std::jthread> threads;
    for (int t = 0; t < 6; ++t) {
      threads.emplace_back([&] {
        for (int i = 0; i < 200; ++i) {
          const ComputeGate::Slot slot(&gate);
          compute();
          { const ComputeGate::Pause pause(&gate); }
          compute();
        }
      });
    }
  }
  EXPECT_LE(most, 2);
}

TEST(ComputeGate, APauseLetsAnotherCompute) {
  ComputeGate gate(1);
  std::latch other_computes(1);
  const ComputeGate::Slot slot(&gate);
  std::jthread other([&] {
    const ComputeGate::Slot theirs(&gate);
    other_computes.count_down();
  });
  const ComputeGate::Pause pause(&gate);
  other_computes.wait();
}

}  // namespace
}  // namespace lightloom
